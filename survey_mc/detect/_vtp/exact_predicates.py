"""Exact answers to the two questions of a triangulation: which way three points turn, who lies inside a circle.

Idea     coordinates are whole numbers with differences below 2²⁶, so that products of two are exact in float64; the
         last sum of the circle test is repeated in integers of two words where rounding could change its sign.
Source   determinants of Guibas & Stolfi 1985; the two-step evaluation follows the idea of Shewchuk 1997.
Limits   larger differences give wrong answers without notice.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from survey_mc.types import FloatArray

COORDINATE_BITS = 26  # of the largest difference of two coordinates
WORD_BITS = 27  # of one word of the exact sum
ROUNDING = 8.0 * 2.0**-53  # of three products and two sums, relative to the sum of the magnitudes, with a margin


@njit(cache=True)
def turn(x: FloatArray, y: FloatArray, a: int, b: int, c: int) -> float:
    """Twice the signed area of the triangle: > 0 if counter-clockwise."""
    i, j, k = np.uint64(a), np.uint64(b), np.uint64(c)
    return float((x[j] - x[i]) * (y[k] - y[i]) - (y[j] - y[i]) * (x[k] - x[i]))


@njit(cache=True)
def circle_side(x: FloatArray, y: FloatArray, a: int, b: int, c: int, p: int) -> int:
    """1 if p lies inside the circle through the counter-clockwise a, b, c; 0 on it; −1 outside."""
    # Numba need not test unsigned indices for being negative: a seventh of the time.
    i, j, k, origin = np.uint64(a), np.uint64(b), np.uint64(c), np.uint64(p)
    ax, ay = x[i] - x[origin], y[i] - y[origin]
    bx, by = x[j] - x[origin], y[j] - y[origin]
    cx, cy = x[k] - x[origin], y[k] - y[origin]
    # Integers below 2⁵³, all exact.
    a_lift, b_lift, c_lift = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    a_turn, b_turn, c_turn = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    a_part, b_part, c_part = a_lift * a_turn, b_lift * b_turn, c_lift * c_turn
    total = a_part + b_part + c_part
    error = ROUNDING * (abs(a_part) + abs(b_part) + abs(c_part))
    if total > error:
        return 1
    if total < -error:
        return -1
    sign: int = exact_sign(a_lift, a_turn, b_lift, b_turn, c_lift, c_turn)
    return sign


@njit(cache=True)
def exact_sign(a_lift: float, a_turn: float, b_lift: float, b_turn: float, c_lift: float, c_turn: float) -> int:
    """Sign of a_lift · a_turn + b_lift · b_turn + c_lift · c_turn for whole numbers below 2⁵³, lifts ≥ 0."""
    mask = (1 << WORD_BITS) - 1
    high = middle = low = np.int64(0)
    for lift, cross in ((a_lift, a_turn), (b_lift, b_turn), (c_lift, c_turn)):
        lift_high, lift_low = np.int64(lift) >> WORD_BITS, np.int64(lift) & mask
        cross_high, cross_low = np.int64(cross) >> WORD_BITS, np.int64(cross) & mask
        high += lift_high * cross_high
        middle += lift_high * cross_low + lift_low * cross_high
        low += lift_low * cross_low
    middle += low >> WORD_BITS
    low &= mask
    high += middle >> WORD_BITS
    middle &= mask
    if high != 0:
        return 1 if high > 0 else -1
    return 1 if middle > 0 or low > 0 else 0
