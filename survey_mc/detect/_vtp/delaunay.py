"""Delaunay triangulation of points at whole numbers, exact whatever their degeneracies.

Idea     a sweep makes it; every result is checked edge by edge and counted by Euler's formula, with Qhull as the
         fallback. Photons in the centres of pixels, all of whose squares are degenerate, need no perturbation.
Source   `_vtp.circle_sweep`; Qhull (Barber, Dobkin & Huhdanpaa 1996) through scipy.
Limits   distinct points with coordinate differences below 2²⁶.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from survey_mc.detect._vtp.circle_sweep import NO_EDGE, EdgeArray, empty_hull, others, sweep
from survey_mc.detect._vtp.exact_predicates import circle_side, turn
from survey_mc.types import FloatArray


class Triangulation(NamedTuple):
    """corner, twin: (3 n_triangles,) half-edges; sides: (n_sides,) one half-edge of each pair of points whose Voronoi
    cells share a side of positive length, which cells of four or more points on one circle may not. None of the hull.
    """

    corner: EdgeArray
    twin: EdgeArray
    sides: EdgeArray


@njit(cache=True)
def find_sides(x: FloatArray, y: FloatArray, corner: EdgeArray, twin: EdgeArray, sides: EdgeArray) -> int:
    """Fill `sides`; their number, or −1 if an edge is not locally Delaunay, twins disagree or a triangle is turned."""
    n_sides = 0
    for h in range(corner.shape[0]):
        if h % 3 == 0 and turn(x, y, corner[h], corner[h + 1], corner[h + 2]) <= 0.0:
            return -1
        g = twin[h]
        if g > h:
            h1, h2 = others(h)
            g1, g2 = others(g)
            a, b = corner[h], corner[h1]
            if twin[g] != h or corner[g] != b or corner[g1] != a:
                return -1
            side = circle_side(x, y, a, b, corner[h2], corner[g2])
            if side > 0:
                return -1
            if side < 0:
                sides[n_sides] = h
                n_sides += 1
    return n_sides


def triangulate(x: FloatArray, y: FloatArray, centre_x: float, centre_y: float) -> Triangulation:
    """Triangulate distinct points in the order of `order_by_distance` from the centre.

    Raises ValueError if there are fewer than three or all lie on one line.
    """
    swept = swept_triangulation(x, y, centre_x, centre_y)
    return swept if swept is not None else qhull_triangulation(x, y)


def swept_triangulation(x: FloatArray, y: FloatArray, centre_x: float, centre_y: float) -> Triangulation | None:
    """The checked triangulation of the sweep, None if there is none."""
    if len(x) < 3:
        return None
    corner = np.empty(6 * len(x), np.int32)
    twin = np.empty(6 * len(x), np.int32)
    bucket, stack = np.empty(math.isqrt(len(x)) + 1, np.int32), np.empty(2 * len(x) + 8, np.int32)
    n_edges = 3 * sweep(x, y, centre_x, centre_y, corner, twin, *empty_hull(len(x)), bucket, stack)
    return None if n_edges < 0 else checked(x, y, corner[:n_edges], twin[:n_edges])


def checked(x: FloatArray, y: FloatArray, corner: EdgeArray, twin: EdgeArray) -> Triangulation | None:
    """The triangulation if all of it is Delaunay and it has as many triangles as Euler demands, else None."""
    n_hull = int((twin < 0).sum())
    if len(corner) // 3 != 2 * len(x) - 2 - n_hull:
        return None
    sides = np.empty(len(corner) // 2, np.int32)
    n_sides = find_sides(x, y, corner, twin, sides)
    return None if n_sides < 0 else Triangulation(corner, twin, sides[:n_sides])


def qhull_triangulation(x: FloatArray, y: FloatArray) -> Triangulation:
    """The same from Qhull; ValueError if the points have no triangulation."""
    from scipy.spatial import Delaunay, QhullError

    try:
        found = Delaunay(np.stack([x, y], axis=1))
    except (QhullError, ValueError) as error:
        raise ValueError(f"cannot triangulate {len(x)} points: fewer than three, or all on one line") from error
    corner = np.ascontiguousarray(found.simplices, dtype=np.int32)
    across = found.neighbors[:, [2, 0, 1]].astype(np.int64)  # beyond the edge from corner k to corner k + 1
    end = np.roll(corner, -1, axis=1)
    starts_there = corner[across] == end[:, :, np.newaxis]
    twin = np.where(across >= 0, 3 * across + np.argmax(starts_there, axis=2), NO_EDGE)
    result = checked(x, y, corner.ravel(), twin.astype(np.int32).ravel())
    if result is None:
        raise ValueError(f"the triangulation of {len(x)} points is not Delaunay")
    return result
