"""What a fit needs of an image: its pixels, and what sources contribute to them.

Idea     the pixels near any source as one list, without repeats; the model of a source in each of them from the table.
Limits   pixels without exposure are left out.
"""

from __future__ import annotations

import math

from numba import njit

from survey_mc.detect._eml.fit import (
    AMPLITUDE,
    EXTENT,
    IS_EXTENDED,
    PIX_BACKGROUND,
    PIX_COUNTS,
    PIX_EXPOSURE,
    PIX_X,
    PIX_Y,
    STEPS_PER_PIX,
    X,
    Y,
    shape_at,
)
from survey_mc.types import FloatArray, FloatImage


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def contributions(sources: FloatArray, pixels: FloatArray, table: FloatArray, parts: FloatArray) -> None:
    """Fill parts[k, i] with the expected counts of source k in pixel i."""
    for k in range(sources.shape[0]):
        low, high, share = 0, 0, 0.0
        if sources[k, IS_EXTENDED] != 0.0:
            low = min(int(sources[k, EXTENT]), table.shape[0] - 3) + 1
            high, share = low + 1, sources[k, EXTENT] + 1.0 - low
        for i in range(pixels.shape[1]):
            dx, dy = pixels[PIX_X, i] - sources[k, X], pixels[PIX_Y, i] - sources[k, Y]
            radius = math.sqrt(dx * dx + dy * dy)
            value = shape_at(table, low, radius)[0]
            if share > 0.0:
                value += share * (shape_at(table, high, radius)[0] - value)
            parts[k, i] = sources[k, AMPLITUDE] * pixels[PIX_EXPOSURE, i] * value


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def pixels_near(
    counts: FloatImage,
    background: FloatImage,
    exposure: FloatImage,
    sources: FloatArray,
    radius_pix: float,
    pixels: FloatArray,
) -> int:
    """Fill the columns of `pixels` with the observed pixels within the radius of any source; their number."""
    n = 0
    for k in range(sources.shape[0]):
        row_low, row_high = math.ceil(sources[k, Y] - radius_pix), math.floor(sources[k, Y] + radius_pix)
        low, high = math.ceil(sources[k, X] - radius_pix), math.floor(sources[k, X] + radius_pix)
        for y in range(max(row_low, 0), min(row_high + 1, counts.shape[0])):
            for x in range(max(low, 0), min(high + 1, counts.shape[1])):
                new = exposure[y, x] > 0.0
                for j in range(k + 1):
                    near = (x - sources[j, X]) ** 2 + (y - sources[j, Y]) ** 2 <= radius_pix**2
                    new = new and near == (j == k)
                if new:
                    pixels[PIX_X, n], pixels[PIX_Y, n], pixels[PIX_COUNTS, n] = x, y, counts[y, x]
                    pixels[PIX_BACKGROUND, n], pixels[PIX_EXPOSURE, n] = background[y, x], exposure[y, x]
                    n += 1
    return n


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def add_to_background(
    background: FloatImage, exposure: FloatImage, sources: FloatArray, table: FloatArray, floor: float, sign: float
) -> None:
    """Add `sign` times the model of the first source to the background, out to where it falls below `floor`."""
    low, row, share = 0, 0, 0.0
    if sources[0, IS_EXTENDED] != 0.0:
        low = min(int(sources[0, EXTENT]), table.shape[0] - 3) + 1
        row, share = min(math.ceil(sources[0, EXTENT]) + 1, table.shape[0] - 1), sources[0, EXTENT] + 1.0 - low
    last = table.shape[1] - 1
    while last >= 0 and sources[0, AMPLITUDE] * table[row, last, 0] <= floor:
        last -= 1
    reach = (last + 1) / STEPS_PER_PIX if last >= 0 else 1.0
    x_pix, y_pix = sources[0, X], sources[0, Y]
    for y in range(max(math.ceil(y_pix - reach), 0), min(math.floor(y_pix + reach) + 1, background.shape[0])):
        for x in range(max(math.ceil(x_pix - reach), 0), min(math.floor(x_pix + reach) + 1, background.shape[1])):
            dx, dy = x - x_pix, y - y_pix
            if exposure[y, x] > 0.0 and dx * dx + dy * dy <= reach * reach:
                radius = math.sqrt(dx * dx + dy * dy)
                value = shape_at(table, low, radius)[0]
                if share > 0.0:
                    value += share * (shape_at(table, low + 1, radius)[0] - value)
                background[y, x] += sign * (sources[0, AMPLITUDE] * exposure[y, x] * value)
