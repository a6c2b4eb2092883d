"""Compiled loops of the sliding cell: Poisson tails of all boxes, and their local maxima.

Idea     integral images give every box sum by four look-ups, whatever the box; only cells that a table of the largest
         admissible background lets pass are looked at any closer. A run of cells is described by the number of pixels
         its image is binned by (`factor`) and by the pixels from one cell to the next (`step`).
Source   tail series of the incomplete gamma function, Abramowitz & Stegun 1965, 6.5.29.
Limits   likelihoods are rounded to 1e-6, so that boxes of the same photons over the same background are equal. Images
         come with a margin of unobserved pixels as wide as the widest frame.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Image = NDArray[np.float64]
Images = NDArray[np.float64]
Indices = NDArray[np.int64]

SERIES_ACCURACY = 1e-16
LIKE_ROUNDING = 1e6
FRAME_WIDTH_PIX = 2  # of the binned image: (n + 4)² − n²
FRAME_WIDEST_PIX = 8  # where a mask or the border cuts the frame
FRAME_WANTED = 0.8  # share of the area of a whole frame below which it is widened
FRAME_LEAST = 0.25  # share below which a cell has no local background

MEAN, FRAME_COUNTS, FRAME_WEIGHT, FRAME_WIDTH = range(4)

# Called from compiled code only: no wrapper for Python, which is quicker to compile.
inner = njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def minus_log_tail(k: int, mean: float) -> float:
    """−ln P(n ≥ k | mean) for 0 < mean < k, exact however far out; 0 for mean ≥ k, where it is below ln 2."""
    if mean >= k:
        return 0.0
    term, total, n = 1.0, 1.0, float(k)
    while term > SERIES_ACCURACY * total:
        n += 1.0
        term *= mean / n
        total += term
    return mean - k * math.log(mean) + math.lgamma(k + 1.0) - math.log(total)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def integral_image(values: Image, exposure: Image, margin: int, sums: Image) -> None:
    """Fill `sums` with the sums of the observed pixels below and to the left, the image in a margin of zeros (pix).

    sums: (ny + 2 margin + 1, nx + 2 margin + 1), zeros.
    """
    height, width = values.shape
    for y in range(margin, sums.shape[0] - 1):
        below, row, total = sums[y], sums[y + 1], 0.0
        if y < margin + height:
            given, seen = values[y - margin], exposure[y - margin]
            for x in range(width):
                if seen[x] > 0.0:
                    total += given[x]
                row[margin + x + 1] = below[margin + x + 1] + total
        for x in range(margin + width + 1 if y < margin + height else margin, row.shape[0]):
            row[x] = below[x] + total


@inner
def box_row(sums: Image, low_y: int, low_x: int, side: int, step: int, out: Image) -> None:
    """Sums over the boxes of a row of cells."""
    reach = (out.shape[0] - 1) * step + 1
    top_left, top_right = sums[low_y, low_x : low_x + reach], sums[low_y, low_x + side : low_x + side + reach]
    bottom_left = sums[low_y + side, low_x : low_x + reach]
    bottom_right = sums[low_y + side, low_x + side : low_x + side + reach]
    for i in range(out.shape[0]):
        at = i * step
        out[i] = bottom_right[at] - top_right[at] - bottom_left[at] + top_left[at]


@inner
def box_sum(sums: Image, low_y: int, low_x: int, side: int) -> float:
    """Sum over one box."""
    high_y, high_x = low_y + side, low_x + side
    upper = sums[high_y, high_x] - sums[high_y, low_x]
    return float(upper - sums[low_y, high_x] + sums[low_y, low_x])


@inner
def wider_frame(sums: Images, low_y: int, low_x: int, side: int, factor: int, block: float) -> tuple[float, float, int]:
    """Counts, weight and width (pix) of a frame around a box that grows outwards until enough of it is observed.

    block: weight of the central block. The weight of the frame is 0 where too little is observed.
    """
    whole = block * (float(side + 2 * FRAME_WIDTH_PIX * factor) ** 2 - side * side) / (factor * factor)
    in_box = box_sum(sums[1], low_y, low_x, side)
    width, weight = FRAME_WIDTH_PIX * factor, 0.0
    while True:
        weight = box_sum(sums[1], low_y - width, low_x - width, side + 2 * width) - in_box
        if weight >= FRAME_WANTED * whole or width >= FRAME_WIDEST_PIX * factor:
            break
        width += factor
    counts = box_sum(sums[0], low_y - width, low_x - width, side + 2 * width) - box_sum(sums[0], low_y, low_x, side)
    return counts, weight if weight >= FRAME_LEAST * whole else 0.0, width


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def cell_likelihoods(
    sums: Images, margin: int, side: int, factor: int, step: int, local: bool, largest_mean: Image, like: Image
) -> tuple[Indices, Image]:
    """Fill `like` with −ln P of all cells of a run, 0 where not significant; index and background of those that are.

    sums: integral images of counts and weight with a margin (pix); side: of a box (pix); largest_mean[k]: largest mean
    that makes k counts significant. Background: a row each of mean in the box, counts, weight and width of the frame.
    """
    n_rows, n_columns = like.shape
    half, wide, last = (side - factor) // 2, FRAME_WIDTH_PIX * factor, largest_mean.shape[0] - 1
    outer = side + 2 * wide
    least = FRAME_WANTED * (outer * outer - side * side) / (factor * factor)
    found, values, n_found = np.empty(n_rows * n_columns, np.int64), np.empty((n_rows * n_columns, 4)), 0
    # Counts and weight in the box, weight of the central block, counts and weight out to the frame's outer edge.
    of, sides = np.array([0, 1, 1, 0, 1]), np.array([side, side, factor, outer, outer])
    rows = np.empty((5, n_columns))
    counts, weight, block, outer_counts, outer_weight = rows[0], rows[1], rows[2], rows[3], rows[4]
    for row in range(n_rows):
        for i in range(5 if local else 2):
            shift = (sides[i] - factor) // 2
            box_row(sums[of[i]], margin + row * step - shift, margin - shift, sides[i], step, rows[i])
        for column in range(n_columns):
            k, mean = int(counts[column]), weight[column]
            limit = largest_mean[k] if k <= last else counts[column]
            if limit <= 0.0 or (not local and mean > limit):
                continue
            in_frame, frame_weight, width = 0.0, 1.0, wide
            if local:
                in_frame, frame_weight = outer_counts[column] - counts[column], outer_weight[column] - mean
                if frame_weight < least * block[column]:
                    low_y, low_x = margin + row * step - half, margin + column * step - half
                    in_frame, frame_weight, width = wider_frame(sums, low_y, low_x, side, factor, block[column])
                mean *= max(in_frame, 1.0)  # an empty frame may be one with a photon less
                if frame_weight <= 0.0 or mean > limit * frame_weight:
                    continue
                mean /= frame_weight
            if mean <= 0.0:
                continue
            like[row, column] = math.floor(minus_log_tail(k, mean) * LIKE_ROUNDING + 0.5) / LIKE_ROUNDING
            found[n_found] = row * n_columns + column
            values[n_found, MEAN], values[n_found, FRAME_COUNTS] = mean, in_frame
            values[n_found, FRAME_WEIGHT], values[n_found, FRAME_WIDTH] = frame_weight, width
            n_found += 1
    return found[:n_found], values[:n_found]


@inner
def spread(counts: Image, exposure: Image, low_y: int, low_x: int, side: int) -> float:
    """Counts in a box, less their second moment in units no sum can reach: larger = more counts, then more compact.

    Counts and moment are exact, so they are the same in all orientations.
    """
    middle, total, moment = 0.5 * (side - 1), 0.0, 0.0
    for y in range(max(low_y, 0), min(low_y + side, counts.shape[0])):
        for x in range(max(low_x, 0), min(low_x + side, counts.shape[1])):
            if exposure[y, x] > 0.0:
                j, i = y - low_y - middle, x - low_x - middle
                total += counts[y, x]
                moment += counts[y, x] * (j * j + i * i)
    return total - moment / (total * side * side)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def local_maxima(
    like: Image, found: Indices, counts: Image, exposure: Image, side: int, factor: int, step: int
) -> NDArray[np.bool_]:
    """Which of the significant cells no other cell surpasses whose centre is inside their box.

    Equal likelihoods: more counts win, then photons nearer to the centre of the box, then the lower row and column.
    """
    n_rows, n_columns = like.shape
    half, reach = (side - factor) // 2, side // (2 * step)
    best = np.ones(found.shape[0], np.bool_)
    for i in range(found.shape[0]):
        row, column = found[i] // n_columns, found[i] % n_columns
        value, own = like[row, column], -1.0
        for j in range(max(row - reach, 0), min(row + reach + 1, n_rows)):
            if not best[i]:
                break
            for k in range(max(column - reach, 0), min(column + reach + 1, n_columns)):
                if like[j, k] > value:
                    best[i] = False
                    break
                if like[j, k] < value or (j == row and k == column):
                    continue
                if own < 0.0:
                    own = spread(counts, exposure, row * step - half, column * step - half, side)
                other = spread(counts, exposure, j * step - half, k * step - half, side)
                if other > own or (other == own and j * n_columns + k < found[i]):
                    best[i] = False
                    break
    return best
