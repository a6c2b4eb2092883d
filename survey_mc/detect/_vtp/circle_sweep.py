"""The sweep that makes a Delaunay triangulation: points by growing distance from a centre, then flips.

Idea     a point further from the centre than all before it lies outside their hull: it is joined to the hull edges it
         sees, and edges whose opposite corner lies inside the circle are flipped until none is left. A table over the
         direction finds a hull edge nearby.
Source   sweep over growing circles: Sinclair 2010 (arXiv:1604.01428); flips: Lawson 1977.
Limits   distinct points. Quadratic in the worst case, which photons do not make (13 circle tests a point).

A half-edge h = 3t + k runs from corner[h] to the next corner of the counter-clockwise triangle t; twin[h] runs back in
the neighbouring triangle, −1 on the hull.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.detect._vtp.exact_predicates import circle_side, turn
from survey_mc.types import FloatArray

LongArray = NDArray[np.int64]
EdgeArray = NDArray[np.int32]

DIGIT_BITS = 11  # of one pass of the radix sort
NO_EDGE = -1


@njit(cache=True)
def order_by_distance(x: FloatArray, y: FloatArray, centre_x: float, centre_y: float) -> LongArray:
    """Indices by ascending distance from the centre; equal distances keep their order (a radix sort)."""
    n = x.shape[0]
    key, order, other = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    n_digits = 1 << DIGIT_BITS
    largest = np.int64(0)
    for i in range(n):
        dx, dy = x[i] - centre_x, y[i] - centre_y
        key[i] = np.int64(dx * dx + dy * dy)
        order[i] = i
        largest = max(largest, key[i])
    shift = 0
    while largest >> shift > 0:
        place = np.zeros(n_digits + 1, np.int64)
        for i in range(n):
            place[((key[i] >> shift) & (n_digits - 1)) + 1] += 1
        for digit in range(n_digits):
            place[digit + 1] += place[digit]
        for i in range(n):
            digit = (key[order[i]] >> shift) & (n_digits - 1)
            other[place[digit]] = order[i]
            place[digit] += 1
        order, other = other, order
        shift += DIGIT_BITS
    return order


@njit(cache=True)
def others(h: int) -> tuple[int, int]:
    """The next and the last half-edge of the same triangle."""
    k = h % 3
    return (h + 1 if k < 2 else h - 2), (h + 2 if k < 1 else h - 1)


@njit(cache=True)
def join(inner: int, outer: int, begin: int, twin: EdgeArray, hull_edge: EdgeArray) -> None:
    """Make two half-edges twins; with no outer one, `inner` is the hull edge of its first corner, `begin`."""
    twin[inner] = outer
    if outer >= 0:
        twin[outer] = inner
    else:
        hull_edge[begin] = inner


@njit(cache=True)
def restore_circles(
    x: FloatArray,
    y: FloatArray,
    corner: EdgeArray,
    twin: EdgeArray,
    hull_edge: EdgeArray,
    stack: EdgeArray,
    n_stack: int,
) -> None:
    """Flip, beginning with the half-edges on the stack, until each circle is empty. Their apex is the new point."""
    while n_stack > 0:
        n_stack -= 1
        h = stack[n_stack]
        g = twin[h]
        if g < 0:
            continue
        h1, h2 = others(h)
        g1, g2 = others(g)
        a, b, p, d = corner[h], corner[h1], corner[h2], corner[g2]
        if circle_side(x, y, b, a, d, p) <= 0:
            continue
        outer_bp, outer_ad, outer_db = twin[h1], twin[g1], twin[g2]
        corner[h1], corner[g], corner[g1], corner[g2] = d, d, b, p
        twin[h1], twin[g2] = g2, h1
        join(g1, outer_bp, b, twin, hull_edge)
        join(h, outer_ad, a, twin, hull_edge)
        join(g, outer_db, d, twin, hull_edge)
        stack[n_stack] = h
        stack[n_stack + 1] = g
        n_stack += 2


@njit(cache=True)
def bucket_of(x: float, y: float, n_buckets: int) -> int:
    """Number, 0 … n_buckets−1, that grows with the direction of (x, y); no trigonometry, so equal on every machine."""
    span = abs(x) + abs(y)
    part = x / span if span > 0.0 else 0.0
    turned = (3.0 - part if y > 0.0 else 1.0 + part) / 4.0
    return min(int(turned * n_buckets), n_buckets - 1)


@njit(cache=True)
def first_visible(
    x: FloatArray, y: FloatArray, p: int, start: int, hull_next: EdgeArray, hull_previous: EdgeArray
) -> int:
    """First corner (counter-clockwise) whose hull edge p sees, searched to both sides of `start`; −1 if none."""
    ahead = behind = start
    while True:
        if turn(x, y, ahead, hull_next[ahead], p) < 0.0:
            first = ahead
            break
        behind = hull_previous[behind]
        if turn(x, y, behind, hull_next[behind], p) < 0.0:
            first = behind
            break
        ahead = hull_next[ahead]
        if ahead == start:
            return -1
    while turn(x, y, hull_previous[first], first, p) < 0.0:
        first = hull_previous[first]
    return first


@njit(cache=True)
def first_fan(
    x: FloatArray,
    y: FloatArray,
    apex: int,
    corner: EdgeArray,
    twin: EdgeArray,
    hull_next: EdgeArray,
    hull_previous: EdgeArray,
    hull_edge: EdgeArray,
) -> int:
    """Join the points before `apex`, which lie on one line, to it; number of half-edges made."""
    along, chain = np.empty(apex), np.empty(apex, np.int64)
    way = 1.0 if turn(x, y, 0, 1, apex) > 0.0 else -1.0
    for i in range(apex):
        step = way * ((x[i] - x[0]) * (x[1] - x[0]) + (y[i] - y[0]) * (y[1] - y[0]))
        k = i
        while k > 0 and along[k - 1] > step:
            along[k], chain[k] = along[k - 1], chain[k - 1]
            k -= 1
        along[k], chain[k] = step, i
    for i in range(apex - 1):
        h = 3 * i
        a, b = chain[i], chain[i + 1]
        corner[h], corner[h + 1], corner[h + 2] = a, b, apex
        twin[h] = NO_EDGE
        twin[h + 1] = h + 5 if i < apex - 2 else NO_EDGE
        twin[h + 2] = h - 2 if i > 0 else NO_EDGE
        hull_edge[a], hull_next[a], hull_previous[b] = h, b, a
    first, last = chain[0], chain[apex - 1]
    n_edges = 3 * (apex - 1)
    hull_edge[last], hull_next[last], hull_previous[apex] = n_edges - 2, apex, last
    hull_edge[apex], hull_next[apex], hull_previous[first] = 2, first, apex
    return n_edges


@njit(cache=True)
def add_fan(
    p: int,
    first: int,
    n_edges: int,
    x: FloatArray,
    y: FloatArray,
    corner: EdgeArray,
    twin: EdgeArray,
    hull_next: EdgeArray,
    hull_previous: EdgeArray,
    hull_edge: EdgeArray,
) -> int:
    """Join p to all hull edges it sees, from that of corner `first` on; the new number of half-edges.

    The first half-edge of each new triangle is opposite p. A corner that leaves the hull gets p as its previous one.
    """
    a = first
    last_edge = NO_EDGE
    while turn(x, y, a, hull_next[a], p) < 0.0:
        b = hull_next[a]
        corner[n_edges], corner[n_edges + 1], corner[n_edges + 2] = b, a, p
        outer = hull_edge[a]
        twin[n_edges], twin[outer] = outer, n_edges
        twin[n_edges + 1] = last_edge
        if last_edge >= 0:
            twin[last_edge] = n_edges + 1
            hull_next[a], hull_previous[a] = -1, p
        else:
            hull_edge[a] = n_edges + 1
        last_edge = n_edges + 2
        twin[last_edge] = NO_EDGE
        n_edges += 3
        a = b
    hull_edge[p] = last_edge
    hull_next[first], hull_previous[p] = p, first
    hull_next[p], hull_previous[a] = a, p
    return n_edges


def empty_hull(n: int) -> tuple[EdgeArray, EdgeArray, EdgeArray]:
    """Next and previous corner and half-edge of each of n points on the hull, −1 while it is not on it."""
    return np.full(n, -1, np.int32), np.full(n, -1, np.int32), np.full(n, -1, np.int32)


@njit(cache=True)
def sweep(
    x: FloatArray,
    y: FloatArray,
    centre_x: float,
    centre_y: float,
    corner: EdgeArray,
    twin: EdgeArray,
    hull_next: EdgeArray,
    hull_previous: EdgeArray,
    hull_edge: EdgeArray,
    bucket: EdgeArray,
    stack: EdgeArray,
) -> int:
    """Triangulate points in order of distance from the centre; number of triangles, −1 if it cannot be done.

    corner, twin: room for 6 half-edges a point; hull_…: `empty_hull`; bucket: about √n; stack: 2n + 8.
    """
    n = x.shape[0]
    n_buckets = bucket.shape[0]
    apex = 2
    while apex < n and turn(x, y, 0, 1, apex) == 0.0:
        apex += 1
    if apex >= n:
        return -1
    n_edges = first_fan(x, y, apex, corner, twin, hull_next, hull_previous, hull_edge)
    for i in range(n_buckets):
        bucket[i] = apex
    for p in range(apex + 1, n):
        slot = bucket_of(x[p] - centre_x, y[p] - centre_y, n_buckets)
        while hull_next[bucket[slot]] < 0:  # it has left the hull; its previous is who covers it
            bucket[slot] = hull_previous[bucket[slot]]
        first = first_visible(x, y, p, bucket[slot], hull_next, hull_previous)
        if first < 0:
            return -1
        n_stack = 0
        n_before = n_edges
        n_edges = add_fan(p, first, n_edges, x, y, corner, twin, hull_next, hull_previous, hull_edge)
        for h in range(n_before, n_edges, 3):
            stack[n_stack] = h
            n_stack += 1
        bucket[slot] = p
        restore_circles(x, y, corner, twin, hull_edge, stack, n_stack)
    return int(n_edges // 3)
