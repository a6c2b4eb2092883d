"""From correlation maxima at many scales to one list of sources.

Idea     scales are read from small to large. A maximum belongs to a known source if it lies in that source's cell, or
         within the PSF's size or the scale at which the source was first seen; otherwise it is a new source. A source
         keeps its highest ratio of correlation to threshold.
Source   Freeman et al. 2002, ApJS 138, 185, Sect. 4 (a maximum is tested to be a new source or one seen before); the
         distance is our choice.
Limits   a large scale that peaks between two blended sources, outside both cells, counts as a source of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.types import FloatArray


@dataclass(frozen=True, slots=True)
class Maxima:
    """Significant local maxima of one scale: pixel, C/C_t."""

    sigma_pix: float
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    ratio: FloatArray


@dataclass(frozen=True, slots=True)
class Sources:
    """(n,) arrays: pixel of the first maximum, hill top of the cell (flat index), highest C/C_t and its scale, number
    of scales that saw the source."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    cell: NDArray[np.int64]
    ratio: FloatArray
    sigma_pix: FloatArray
    n_scales: NDArray[np.int64]


def cells_of(maxima: Maxima, top: NDArray[np.int32], flux: NDArray[np.float32], floor: float) -> NDArray[np.int64]:
    """Hill top of the cell of each maximum, −1: none.

    A maximum of a large scale may stand in a hollow below the floor; its cell is then the highest hill within σ.
    """
    width = flux.shape[1]
    heights = flux.ravel()
    cell: NDArray[np.int64] = top[maxima.row * width + maxima.column].astype(np.int64)
    reach = math.ceil(maxima.sigma_pix)
    for i in np.flatnonzero((cell < 0) | (heights[cell] <= floor)):
        y0, x0 = max(maxima.row[i] - reach, 0), max(maxima.column[i] - reach, 0)
        window = flux[y0 : maxima.row[i] + reach + 1, x0 : maxima.column[i] + reach + 1]
        y, x = np.unravel_index(int(window.argmax()), window.shape)
        cell[i] = top[(y0 + y) * width + x0 + x] if window[y, x] > floor else -1
    return cell


def merged_sources(
    scales: list[Maxima], top: NDArray[np.int32], flux: NDArray[np.float32], floor: float, psf_radius_pix: float
) -> Sources:
    """Sources of all scales, ascending.

    top: hill top that every pixel of the flux image climbs to (flat, −1: none); floor: cells are above it.
    """
    place = np.empty((0, 2), dtype=np.int64)
    cell = np.empty(0, dtype=np.int64)
    reach, ratio, sigma = np.empty(0), np.empty(0), np.empty(0)
    n_scales = np.empty(0, dtype=np.int64)
    for maxima in scales:
        order = np.lexsort((maxima.column, maxima.row, -maxima.ratio))
        spot = np.stack([maxima.row, maxima.column], axis=1)[order]
        found_ratio = maxima.ratio[order]
        found_cell = cells_of(maxima, top, flux, floor)[order]
        owner = known_source(spot, found_cell, place, cell, reach)
        # New sources of one scale are told apart by their cells alone.
        fresh = np.flatnonzero((owner < 0) & (found_cell >= 0))
        _cells, first, which = np.unique(found_cell[fresh], return_index=True, return_inverse=True)
        rank = np.argsort(np.argsort(first))
        owner[fresh] = len(cell) + rank[which]
        new = fresh[np.sort(first)]
        place = np.concatenate([place, spot[new]])
        cell = np.concatenate([cell, found_cell[new]])
        reach = np.concatenate([reach, np.full(new.size, max(psf_radius_pix, maxima.sigma_pix))])
        ratio, sigma = (np.concatenate([values, np.zeros(new.size)]) for values in (ratio, sigma))
        n_scales = np.concatenate([n_scales, np.zeros(new.size, dtype=np.int64)])
        for i, value in zip(owner[::-1], found_ratio[::-1], strict=True):
            if i >= 0 and value > ratio[i]:
                ratio[i], sigma[i] = value, maxima.sigma_pix
        n_scales[np.unique(owner[owner >= 0])] += 1
    return Sources(place[:, 0], place[:, 1], cell, ratio, sigma, n_scales)


def known_source(
    spot: NDArray[np.int64],
    spot_cell: NDArray[np.int64],
    place: NDArray[np.int64],
    cell: NDArray[np.int64],
    reach: FloatArray,
) -> NDArray[np.int64]:
    """Number of the known source each maximum belongs to, −1: none. Its own cell goes before the nearest in reach."""
    owner = np.full(len(spot), -1, dtype=np.int64)
    if len(place) == 0 or len(spot) == 0:
        return owner
    order = np.argsort(cell)
    candidate = order[np.minimum(np.searchsorted(cell, spot_cell, sorter=order), len(cell) - 1)]
    owner = np.where(cell[candidate] == spot_cell, candidate, -1)
    stray = np.flatnonzero(owner < 0)
    distance2 = np.square(spot[stray, None, :] - place).sum(axis=2).astype(np.float64)
    near = np.where(distance2 <= np.square(reach), distance2, np.inf)
    nearest = near.argmin(axis=1)
    owner[stray] = np.where(np.isfinite(near[np.arange(len(stray)), nearest]), nearest, -1)
    return owner
