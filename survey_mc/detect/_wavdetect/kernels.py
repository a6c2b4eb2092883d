"""Search of a correlation image for pixels above their threshold.

Idea     one pass leaves out all pixels that are below a bound of the threshold which needs no table.
Limits   single precision, as the images.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Image = NDArray[np.float32]
Pixels = NDArray[np.int64]


@njit(cache=True)
def likely_pixels(
    correlation: Image, exposure: Image, noise: Image, rate: Image, sure_squared: float, least: float
) -> tuple[Pixels, NDArray[np.float64], NDArray[np.float64]]:
    """Flat index, C and background b of the pixels with C > least and C² > sure_squared · b.

    C = correlation − exposure · rate; b = noise · rate; pixels without noise are not analysed.
    """
    height, width = correlation.shape
    lowest = np.float32(least)
    bound = np.float32(sure_squared)
    n = 0
    pixel = np.empty(correlation.size, np.int64)
    likely = np.empty(width, np.bool_)
    for y in range(height):
        light, seen, noisy, sky = correlation[y], exposure[y], noise[y], rate[y]
        any_likely = 0
        for x in range(width):  # without a branch, so that the processor does several pixels at once
            excess = light[x] - seen[x] * sky[x]
            likely[x] = (excess > lowest) & (excess * excess > bound * noisy[x] * sky[x]) & (noisy[x] > 0.0)
            any_likely += likely[x]
        if any_likely > 0:
            for x in range(width):
                if likely[x]:
                    pixel[n] = y * width + x
                    n += 1
    excesses, backgrounds = np.empty(n), np.empty(n)
    for i in range(n):
        y, x = pixel[i] // width, pixel[i] % width
        excesses[i] = correlation[y, x] - exposure[y, x] * rate[y, x]
        backgrounds[i] = noise[y, x] * rate[y, x]
    return pixel[:n].copy(), excesses, backgrounds


@njit(cache=True)
def are_maxima(
    correlation: Image, exposure: Image, rate: Image, observed: NDArray[np.bool_], pixels: Pixels
) -> NDArray[np.bool_]:
    """Whether C of each pixel is above all observed ones of its eight neighbours; of equals the first is."""
    height, width = correlation.shape
    highest = np.ones(pixels.shape[0], np.bool_)
    for i in range(pixels.shape[0]):
        y, x = pixels[i] // width, pixels[i] % width
        here = correlation[y, x] - exposure[y, x] * rate[y, x]
        for v in range(max(y - 1, 0), min(y + 2, height)):
            for u in range(max(x - 1, 0), min(x + 2, width)):
                there = correlation[v, u] - exposure[v, u] * rate[v, u]
                before = v < y or (v == y and u < x)
                if observed[v, u] and (there > here or (before and there == here)):
                    highest[i] = False
                    break
            if not highest[i]:
                break
    return highest
