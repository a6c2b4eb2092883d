"""Loops of ewavelet that numpy cannot say: images of Gaussian sources, the hat at single pixels, the merge over scales.

Limits   sources are painted at pixel centres ± fractions, out to 5 widths.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

PAINT_REACH = 5.0  # of a Gaussian source, in its standard deviations


@njit(cache=True)
def paint_gaussians(
    x_pix: NDArray[np.float64],
    y_pix: NDArray[np.float64],
    counts: NDArray[np.float64],
    width_pix: NDArray[np.float64],
    image: NDArray[np.float32],
) -> None:
    """Add Gaussian sources (counts per pixel) to the image, in place."""
    height, width = image.shape
    for i in range(x_pix.shape[0]):
        half = math.ceil(PAINT_REACH * width_pix[i])
        column, row = int(np.rint(x_pix[i])), int(np.rint(y_pix[i]))
        first, last = max(column - half, 0), min(column + half, width - 1)
        along_x = np.empty(last - first + 1)
        for x in range(first, last + 1):
            along_x[x - first] = math.exp(-0.5 * ((x - x_pix[i]) / width_pix[i]) ** 2)
        peak = counts[i] / (2.0 * math.pi * width_pix[i] ** 2)
        for y in range(max(row - half, 0), min(row + half, height - 1) + 1):
            here = peak * math.exp(-0.5 * ((y - y_pix[i]) / width_pix[i]) ** 2)
            for x in range(first, last + 1):
                image[y, x] += np.float32(here * along_x[x - first])


@njit(cache=True)
def hat_at(image: NDArray[np.float32], place: NDArray[np.int64], hat: NDArray[np.float32]) -> NDArray[np.float64]:
    """(n,) hat-weighted sums of the image around (row, column) pixels, zero outside of it."""
    half = hat.shape[0] // 2
    height, width = image.shape
    sums = np.zeros(place.shape[0])
    for i in range(place.shape[0]):
        row, column = place[i, 0], place[i, 1]
        first, last = max(column - half, 0), min(column + half, width - 1)
        along = np.zeros(last - first + 1, np.float32)  # one sum a column: these additions become vector instructions
        for y in range(max(row - half, 0), min(row + half, height - 1) + 1):
            weights = hat[y - row + half, first - column + half : last - column + half + 1]
            values = image[y, first : last + 1]
            for x in range(along.shape[0]):
                along[x] += weights[x] * values[x]
        sums[i] = along.sum()
    return sums


@njit(cache=True)
def ring_rate(
    around: NDArray[np.float32], response: NDArray[np.float32], least: tuple[float, float], overall: float
) -> NDArray[np.float32]:
    """Counts per fully exposed pixel in the ring around each pixel: ring mean of the image over that of the exposure.

    least: exposed share of the ring below which the `overall` rate is taken, and the least rate.
    """
    least_share, least_rate = np.float32(least[0]), np.float32(least[1])
    rate = np.full(around.shape, np.float32(overall))
    for y in range(around.shape[0]):
        photons, exposed, row = around[y], response[y], rate[y]
        for x in range(row.shape[0]):
            if exposed[x] > least_share:
                row[x] = max(photons[x] / exposed[x], least_rate)
    return rate


@njit(cache=True)
def corrected(
    raw: NDArray[np.float32],
    response: NDArray[np.float32],
    rate: NDArray[np.float32],
    exposure: NDArray[np.float32],
    least_exposure: float,
    plane: NDArray[np.float32],
    background: NDArray[np.float32],
) -> None:
    """plane = raw − response · rate, −∞ where the exposure is 0 or below the least; background = exposure · rate."""
    least = max(np.float32(least_exposure), np.float32(1e-30))
    nothing = np.float32(-np.inf)
    for y in range(raw.shape[0]):
        given, answer, local, share, out, level = raw[y], response[y], rate[y], exposure[y], plane[y], background[y]
        # Two loops with one target each: the compiler can then tell that nothing overlaps, and makes vectors.
        for x in range(given.shape[0]):
            value = given[x] - answer[x] * local[x]
            out[x] = value if share[x] >= least else nothing
        for x in range(given.shape[0]):
            level[x] = share[x] * local[x]


@njit(cache=True)
def chosen_of_each(
    x_pix: NDArray[np.float64], y_pix: NDArray[np.float64], scale: NDArray[np.float64], radius: float
) -> NDArray[np.int64]:
    """Index of the candidate that stands for each candidate, which are given in order of preference.

    A candidate stands for itself unless a preferred one of another scale is within `radius` times the larger scale.
    """
    n = x_pix.shape[0]
    owner = np.empty(n, np.int64)
    chosen = np.empty(n, np.int64)
    n_chosen = 0
    for i in range(n):
        owner[i] = i
        for j in range(n_chosen):
            other = chosen[j]
            reach = radius * max(scale[i], scale[other])
            dx, dy = x_pix[i] - x_pix[other], y_pix[i] - y_pix[other]
            if scale[i] != scale[other] and dx * dx + dy * dy <= reach * reach:
                owner[i] = other
                break
        if owner[i] == i:
            chosen[n_chosen] = i
            n_chosen += 1
    return owner
