"""Areas and neighbours of the Voronoi cells inside an image, from the Delaunay triangles.

Idea     each triangle gives each of its corners the quadrilateral between the corner, the middles of its two edges and
         the circumcentre, with its sign; the sum is the cell. Where a circumcentre lies beyond the image the cell is
         cut by its four sides instead. Four far points around the image bound every cell. Cells are neighbours if an
         end of their common side lies in an observed pixel: beyond the border distant cells would meet.
Source   duality of the Voronoi and Delaunay tessellations; polygon clipping: Sutherland & Hodgman 1974.
Limits   only cells of points in the image have a meaning. Areas are rounded to 2⁻⁴⁰ pixels², so that equal cells
         are equal wherever they lie.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from survey_mc.detect._vtp.circle_sweep import EdgeArray, others
from survey_mc.detect._vtp.delaunay import Triangulation
from survey_mc.types import BoolArray, FloatArray

ROUND_AREA = 2.0**40  # the smallest cell of the grid of positions is a thousand times larger
FAR_SIDES = (
    2.0  # the far points lie this many sides of the square around the rectangle beyond it: more than its diagonal
)


def far_points(width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """x, y (pixels) of four points so far from every pixel that they cut nothing off a cell inside the image."""
    reach = int((0.5 + FAR_SIDES) * max(width, height)) + 1
    middle_x, middle_y = width // 2, height // 2
    x = np.array([middle_x - reach, middle_x + reach, middle_x + reach, middle_x - reach], dtype=np.float64)
    y = np.array([middle_y - reach, middle_y - reach, middle_y + reach, middle_y + reach], dtype=np.float64)
    return x, y


@njit(cache=True)
def circumcentre(x: FloatArray, y: FloatArray, a: int, b: int, c: int) -> tuple[float, float]:
    """Centre of the circle through a, b, c, relative to a."""
    bx, by = x[b] - x[a], y[b] - y[a]
    cx, cy = x[c] - x[a], y[c] - y[a]
    twice = 2.0 * (bx * cy - by * cx)
    b_lift, c_lift = bx * bx + by * by, cx * cx + cy * cy
    return (cy * b_lift - by * c_lift) / twice, (bx * c_lift - cx * b_lift) / twice


@njit(cache=True)
def triangle_sums(
    x: FloatArray,
    y: FloatArray,
    corner: EdgeArray,
    bits: int,
    observed: BoolArray,
    area: FloatArray,
    spoke: EdgeArray,
    whole: BoolArray,
    seen: BoolArray,
) -> None:
    """Add up the areas of all cells.

    spoke: one half-edge from each cell's point if the cell leaves the image, else −1; whole: False for cells with a
    corner in an unobserved pixel of the image or nearest to one; seen: of each triangle, whether its circumcentre is in
    an observed pixel.
    """
    height, width = observed.shape
    unit = float(1 << bits)
    for h in range(0, corner.shape[0], 3):
        a, b, c = corner[h], corner[h + 1], corner[h + 2]
        ux, uy = circumcentre(x, y, a, b, c)
        bx, by = x[b] - x[a], y[b] - y[a]
        cx, cy = x[c] - x[a], y[c] - y[a]
        # Twice the signed areas between the circumcentre and the halves of the edges ab, bc and ca.
        half_ab = 0.5 * (bx * uy - by * ux)
        half_ca = 0.5 * (ux * cy - uy * cx)
        half_bc = 0.5 * ((cx - bx) * (uy - by) - (cy - by) * (ux - bx))
        area[a] += 0.5 * (half_ab + half_ca)
        area[b] += 0.5 * (half_ab + half_bc)
        area[c] += 0.5 * (half_bc + half_ca)
        column, row = (x[a] + ux) / unit + 0.5, (y[a] + uy) / unit + 0.5
        inside = 0.0 <= column <= width and 0.0 <= row <= height
        if not inside:
            spoke[a], spoke[b], spoke[c] = h, h + 1, h + 2
        nearest_column = int(min(max(column, 0.0), width - 1.0))
        nearest_row = int(min(max(row, 0.0), height - 1.0))
        if not observed[nearest_row, nearest_column]:
            whole[a] = whole[b] = whole[c] = False
        seen[h // 3] = inside and observed[nearest_row, nearest_column]


@njit(cache=True)
def cut(x: FloatArray, y: FloatArray, n: int, limit: float, sign: float, out_x: FloatArray, out_y: FloatArray) -> int:
    """Corners of a convex polygon where sign · x ≤ sign · limit; the number that is left."""
    n_left = 0
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        here, there = sign * (limit - x[i]), sign * (limit - x[k])
        if here >= 0.0:
            out_x[n_left], out_y[n_left] = x[i], y[i]
            n_left += 1
        if (here >= 0.0) != (there >= 0.0):
            share = here / (here - there)
            out_x[n_left], out_y[n_left] = limit, y[i] + share * (y[k] - y[i])
            n_left += 1
    return n_left


@njit(cache=True)
def clipped_area(
    x: FloatArray, y: FloatArray, corner: EdgeArray, twin: EdgeArray, spoke: int, box: FloatArray
) -> float:
    """Area inside the box of the cell of corner[spoke]; the point must not be on the hull."""
    point = corner[spoke]
    n = 0
    h = spoke
    while True:
        n += 1
        h = twin[others(h)[1]]
        if h == spoke:
            break
    ax, ay, bx, by = np.empty(n + 8), np.empty(n + 8), np.empty(n + 8), np.empty(n + 8)
    for i in range(n):
        h1, h2 = others(h)
        ux, uy = circumcentre(x, y, point, corner[h1], corner[h2])
        ax[i], ay[i] = x[point] + ux, y[point] + uy
        h = twin[h2]
    n = cut(ax, ay, n, box[0], -1.0, bx, by)
    n = cut(by, bx, n, box[1], -1.0, ay, ax)
    n = cut(ax, ay, n, box[2], 1.0, bx, by)
    n = cut(by, bx, n, box[3], 1.0, ay, ax)
    twice = 0.0
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        twice += (ax[i] - x[point]) * (ay[k] - y[point]) - (ax[k] - x[point]) * (ay[i] - y[point])
    return 0.5 * twice


@njit(cache=True)
def clip_cells(
    x: FloatArray,
    y: FloatArray,
    corner: EdgeArray,
    twin: EdgeArray,
    box: FloatArray,
    spoke: EdgeArray,
    area: FloatArray,
) -> None:
    """Replace the areas of the cells with a spoke by what of them lies in the box."""
    for i in range(area.shape[0]):
        if spoke[i] >= 0:
            area[i] = clipped_area(x, y, corner, twin, spoke[i], box)


@njit(cache=True)
def find_neighbours(
    corner: EdgeArray, twin: EdgeArray, sides: EdgeArray, seen: BoolArray, n_cells: int, pairs: EdgeArray
) -> int:
    """Fill `pairs` with the cells, far ones apart, to both sides of each side that has a seen end; their number."""
    n_pairs = 0
    for i in range(sides.shape[0]):
        h = sides[i]
        g = twin[h]
        a, b = corner[h], corner[g]
        if (seen[h // 3] or seen[g // 3]) and a < n_cells and b < n_cells:
            pairs[n_pairs, 0], pairs[n_pairs, 1] = a, b
            n_pairs += 1
    return n_pairs


class VoronoiCells(NamedTuple):
    """area_pix: (n,) inside the image, pixels²; whole: (n,) False if the cell reaches unobserved pixels of the image;
    inside: (n,) False if it was cut by the image border; neighbours: (n_pairs, 2)."""

    area_pix: FloatArray
    whole: BoolArray
    inside: BoolArray
    neighbours: EdgeArray


def voronoi_cells(
    x: FloatArray, y: FloatArray, n_cells: int, mesh: Triangulation, observed: BoolArray, bits: int
) -> VoronoiCells:
    """Cells of the first n_cells points; those after them are the far ones.

    x and y count in steps of 2^−bits pixels.
    """
    area, spoke = np.zeros(len(x)), np.full(len(x), -1, np.int32)
    whole, seen = np.ones(len(x), dtype=np.bool_), np.ones(len(mesh.corner) // 3, dtype=np.bool_)
    triangle_sums(x, y, mesh.corner, bits, observed, area, spoke, whole, seen)
    spoke[n_cells:] = -1
    unit = float(1 << bits)
    box = np.array([-0.5, -0.5, observed.shape[1] - 0.5, observed.shape[0] - 0.5]) * unit
    clip_cells(x, y, mesh.corner, mesh.twin, box, spoke, area)
    steps = np.maximum(np.rint(area[:n_cells] * (ROUND_AREA / unit**2)), 1.0)
    pairs = np.empty((len(mesh.sides), 2), np.int32)
    n_pairs = find_neighbours(mesh.corner, mesh.twin, mesh.sides, seen, n_cells, pairs)
    return VoronoiCells(steps / ROUND_AREA, whole[:n_cells], spoke[:n_cells] < 0, pairs[:n_pairs])
