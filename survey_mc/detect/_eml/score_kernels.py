"""Compiled sums over the pixels of a group: what a source is worth, where one more promises most.

Idea     loops over a few hundred pixels and a few sources, without arrays in between. They take shapes and models that
         `_eml.kernels.contributions` has filled, which keeps them quick to compile.
Source   Cash 1979, ApJ 228, 939, for the falls of C; Rao 1948 for the scores.
Limits   sums run over the pixels in their order.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.detect._eml.fit import PIX_BACKGROUND, PIX_COUNTS, PIX_X, PIX_Y, X, Y
from survey_mc.types import BoolArray, FloatArray

SLOPE, FISHER, MIXED = range(3)

kernel = njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)


@kernel
def falls_alone(parts: FloatArray, pixels: FloatArray, cash: float, fall: FloatArray) -> None:
    """Fill in by how much each source makes C fall, the others as they are; parts: of each source in each pixel."""
    n_sources, n_pixels = parts.shape
    total = np.empty(n_pixels)
    for i in range(n_pixels):
        total[i] = parts[0, i]
        for k in range(1, n_sources):
            total[i] += parts[k, i]
    for k in range(n_sources):
        excess, logs = 0.0, 0.0
        for i in range(n_pixels):
            rest = max(total[i] - parts[k, i], 0.0)
            excess += rest
            if pixels[PIX_COUNTS, i] > 0.0:
                logs += pixels[PIX_COUNTS, i] * math.log1p(rest / pixels[PIX_BACKGROUND, i])
        fall[k] = 2.0 * (excess - logs) - cash


@kernel
def fill_scores(pixels: FloatArray, model: FloatArray, shapes: FloatArray, sums: FloatArray) -> None:
    """Fill sums[:, a] of shape a: slope of −C/2, Fisher information, and that shared with shape 0."""
    for a in range(shapes.shape[0]):
        slope, fisher, mixed = 0.0, 0.0, 0.0
        for i in range(shapes.shape[1]):
            weighted = shapes[a, i] / model[i]
            slope += weighted * pixels[PIX_COUNTS, i] - shapes[a, i]
            fisher += weighted * shapes[a, i]
            mixed += weighted * shapes[0, i]
        sums[SLOPE, a], sums[FISHER, a], sums[MIXED, a] = slope, fisher, mixed


@kernel
def largest_excesses(
    sources: FloatArray,
    k: int,
    pixels: FloatArray,
    model: FloatArray,
    apart_pix: float,
    reach_pix: float,
    places: NDArray[np.int64],
) -> int:
    """Fill in the pixels with the largest excess over the model (in σ), largest first; their number.

    Only pixels nearer to source k than to any other, within its reach, and at least `apart_pix` away from it.
    """
    n, most = 0, places.shape[0]
    rank = np.empty(most)
    for i in range(pixels.shape[1]):
        residual = pixels[PIX_COUNTS, i] / model[i] - 1.0
        excess = residual * math.sqrt(model[i])
        if residual <= 0.0 or (n == most and excess <= rank[most - 1]):
            continue
        apart2 = (pixels[PIX_X, i] - sources[k, X]) ** 2 + (pixels[PIX_Y, i] - sources[k, Y]) ** 2
        own = apart_pix * apart_pix <= apart2 <= reach_pix * reach_pix
        for j in range(sources.shape[0]):
            own &= apart2 <= (pixels[PIX_X, i] - sources[j, X]) ** 2 + (pixels[PIX_Y, i] - sources[j, Y]) ** 2
        if own:
            at = min(n, most - 1)
            while at > 0 and rank[at - 1] < excess:
                rank[at], places[at] = rank[at - 1], places[at - 1]
                at -= 1
            rank[at], places[at] = excess, i
            n = min(n + 1, most)
    return n


@kernel
def take_neighbours(
    places: FloatArray, waiting: BoolArray, first: int, radius_pix: float, members: NDArray[np.int64]
) -> int:
    """Fill in the waiting places from number `first` on within the radius of it, as many as fit; their number.

    They wait no longer.
    """
    n = 0
    for i in range(first, places.shape[0]):
        if n == members.shape[0]:
            break
        if waiting[i] and math.hypot(places[i, 0] - places[first, 0], places[i, 1] - places[first, 1]) <= radius_pix:
            members[n] = i
            waiting[i] = False
            n += 1
    return n
