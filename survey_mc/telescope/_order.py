"""The order in which photons leave the telescope: by pixel, then by x, whatever they come from.

Idea     in order of drawing they would tell source from background. The photons of the sources are sorted by (row, x)
         in two counting passes and merged with the background, which is drawn in that order already.
Limits   at most 2³¹ photons.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.telescope._draw import BELOW_ONE
from survey_mc.types import FloatArray, FloatImage, IntArray, IntImage

_BINS_PER_COLUMN = 8  # fine columns of the sorting: the more, the less is left to move in bright pixels
_BINS_PER_FRACTION = 4096
_STRIDE = 8  # pixels passed at once on the way to the next background photon
_BRIGHT_COLUMN = 500  # photons in a fine column from which moving them one by one costs more than another pass


@njit(cache=True)
def _sorted_by_fraction(photons: FloatArray) -> FloatArray:
    """Photons (n, 3) by their place inside their fine column: a first pass for fields with very bright pixels."""
    start = np.zeros(_BINS_PER_FRACTION + 1, np.int32)
    key = np.empty(photons.shape[0], np.int32)
    for i in range(photons.shape[0]):
        x = (photons[i, 0] + 0.5) * _BINS_PER_COLUMN
        key[i] = int((x - math.floor(x)) * _BINS_PER_FRACTION)
        start[key[i] + 1] += 1
    for c in range(_BINS_PER_FRACTION):
        start[c + 1] += start[c]
    ordered = np.empty_like(photons)
    for i in range(photons.shape[0]):
        k = start[key[i]]
        start[key[i]] = k + 1
        ordered[k, 0], ordered[k, 1], ordered[k, 2] = photons[i, 0], photons[i, 1], photons[i, 2]
    return ordered


@njit(cache=True)
def sorted_by_row(photons: FloatArray, ny: int, nx: int) -> FloatArray:
    """Photons (n, 3) in order of row and, within a row, of x.

    Counting passes, fine columns then rows, and an insertion for the order inside a fine column. Overwrites its input.
    """
    n = photons.shape[0]
    column_start = np.zeros(nx * _BINS_PER_COLUMN + 1, np.int32)
    row_start = np.zeros(ny + 1, np.int32)
    for i in range(n):
        column_start[int((photons[i, 0] + 0.5) * _BINS_PER_COLUMN) + 1] += 1
        row_start[int(photons[i, 1] + 0.5) + 1] += 1
    if column_start.max() > _BRIGHT_COLUMN:
        photons = _sorted_by_fraction(photons)
    for c in range(nx * _BINS_PER_COLUMN):
        column_start[c + 1] += column_start[c]
    for r in range(ny):
        row_start[r + 1] += row_start[r]

    by_column = np.empty_like(photons)
    for i in range(n):
        c = int((photons[i, 0] + 0.5) * _BINS_PER_COLUMN)
        k = column_start[c]
        column_start[c] = k + 1
        by_column[k, 0], by_column[k, 1], by_column[k, 2] = photons[i, 0], photons[i, 1], photons[i, 2]
    ordered = photons
    row_end = row_start[:-1].copy()
    for i in range(n):
        x, y, source = by_column[i, 0], by_column[i, 1], by_column[i, 2]
        r = int(y + 0.5)
        k = row_end[r]
        row_end[r] = k + 1
        while k > row_start[r] and ordered[k - 1, 0] > x:
            ordered[k, 0], ordered[k, 1], ordered[k, 2] = ordered[k - 1, 0], ordered[k - 1, 1], ordered[k - 1, 2]
            k -= 1
        ordered[k, 0], ordered[k, 1], ordered[k, 2] = x, y, source
    return ordered


@njit(cache=True)
def merged(
    expected: FloatImage,
    edges: FloatArray,
    levels: FloatArray,
    heights: FloatArray,
    photons: FloatArray,
) -> tuple[IntImage, FloatArray, IntArray, NDArray[np.int64]]:
    """Background and source photons row by row, x ascending in a row.

    The background is the process `levels` along `expected`, as in `place_in_pixels`; edges: (ny·nx + 1,) accumulated
    expectation before each pixel and after the last; photons are from `sorted_by_row`. Returns counts (ny, nx),
    positions (n, 2), origin (n,; −1 for background) and the first photon of each row (ny + 1,).
    """
    ny, nx = expected.shape
    means = expected.ravel()
    n_sources = photons.shape[0]
    positions = np.empty((levels.size + n_sources, 2))
    origin = np.empty(levels.size + n_sources, np.int32)
    counts = np.zeros((ny, nx), np.int32)
    each = counts.ravel()
    row_start = np.zeros(ny + 1, np.int64)
    n = s = pixel = row = 0
    next_pixel = _pixel_of(photons, s, nx)
    for b in range(levels.size + 1):
        pixel = _pixel_of_level(edges, pixel, levels[b]) if b < levels.size else means.size
        while (row + 1) * nx <= pixel:
            row += 1
        x = np.inf
        if pixel < means.size:
            x = pixel - row * nx - 0.5 + min((levels[b] - edges[pixel]) / means[pixel], BELOW_ONE)
        while next_pixel < pixel or (next_pixel == pixel and s < n_sources and photons[s, 0] < x):
            positions[n, 0], positions[n, 1] = photons[s, 0], photons[s, 1]
            origin[n] = int(photons[s, 2])
            each[next_pixel] += 1
            row_start[next_pixel // nx + 1] += 1
            n += 1
            s += 1
            next_pixel = _pixel_of(photons, s, nx)
        if pixel == means.size:
            break
        positions[n, 0], positions[n, 1] = x, row - 0.5 + heights[b]
        origin[n] = -1
        each[pixel] += 1
        row_start[row + 1] += 1
        n += 1
    for y in range(ny):
        row_start[y + 1] += row_start[y]
    return counts, positions[:n], origin[:n], row_start


@njit(cache=True)
def _pixel_of_level(edges: FloatArray, pixel: int, level: float) -> int:
    """First pixel from `pixel` on whose upper edge is above a level that is at or above its lower edge."""
    n_pix = edges.size - 1
    while pixel + _STRIDE < n_pix and edges[pixel + _STRIDE] <= level:
        pixel += _STRIDE
    if pixel + _STRIDE < n_pix:
        # Counting is quicker than stopping: where it would stop, the processor cannot foresee.
        beyond = 0
        for k in range(1, _STRIDE):
            beyond += edges[pixel + k] <= level
        return pixel + beyond
    while pixel < n_pix and edges[pixel + 1] <= level:
        pixel += 1
    return pixel


@njit(cache=True)
def _pixel_of(photons: FloatArray, s: int, nx: int) -> int:
    """Row-major pixel of a photon; beyond every pixel when there are no more photons."""
    if s >= photons.shape[0]:
        return np.iinfo(np.int64).max
    return int(photons[s, 1] + 0.5) * nx + int(photons[s, 0] + 0.5)
