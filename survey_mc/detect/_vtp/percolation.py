"""Friends of friends among Voronoi cells.

Idea     two bright cells that share a side belong to one group (union-find).
Source   Ebeling & Wiedenmann 1993, Phys. Rev. E 47, 704.
Limits   cells that meet in one point only are not neighbours; with photons in pixel centres these are the diagonals of
         occupied 2 × 2 squares, which an arbitrary triangulation would join at random.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from survey_mc.detect._vtp.circle_sweep import EdgeArray
from survey_mc.types import BoolArray


@njit(cache=True)
def root(parent: EdgeArray, i: int) -> int:
    """First member of the group of i; shortens the way for the next call."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True)
def join_neighbours(neighbours: EdgeArray, bright: BoolArray, parent: EdgeArray) -> None:
    """Unite bright neighbours; on return `parent` points at the first member of each group."""
    for k in range(neighbours.shape[0]):
        a, b = neighbours[k, 0], neighbours[k, 1]
        if bright[a] and bright[b]:
            first, second = root(parent, a), root(parent, b)
            if first < second:
                parent[second] = first
            else:
                parent[first] = second
    for i in range(parent.shape[0]):
        parent[i] = root(parent, i)


def groups(neighbours: EdgeArray, bright: BoolArray) -> EdgeArray:
    """(n_points,) number of each bright cell's group, from 0 in the order of their first cells; −1: not bright.

    neighbours: (n_pairs, 2) cells that share a side.
    """
    parent = np.arange(len(bright), dtype=np.int32)
    join_neighbours(neighbours, bright, parent)
    first = bright & (parent == np.arange(len(bright)))
    number = np.cumsum(first, dtype=np.int32) - np.int32(1)
    return np.asarray(np.where(bright, number[parent], np.int32(-1)), dtype=np.int32)
