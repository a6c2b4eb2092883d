"""Isophotal areas of segmented objects: how steeply an object falls from its peak to its threshold.

Idea     ISO_i = pixels of the object brighter than t·(peak/t)^{i/8}, i = 0 … 7: eight levels, equally spaced in the
         logarithm between the threshold t and the peak.
Source   Bertin & Arnouts 1996 A&AS 117, 393, Sect. 8; the output parameters ISO0 … ISO7 of SExtractor.
Limits   one t for an object, that of its peak: where the threshold varies, ISO0 may differ from the isophote by a few
         pixels of its rim.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

N_LEVELS = 8


@njit(cache=True)
def isophotal_areas(
    segments: NDArray[np.int32],
    box: NDArray[np.int64],
    signal: NDArray[np.float32],
    peak: NDArray[np.float64],
    threshold: NDArray[np.float64],
) -> NDArray[np.int32]:
    """Pixels (n, 8) of each object above its eight levels; object i has the value i + 1 in `segments`.

    box: (n, 4) xmin, xmax, ymin, ymax, inclusive. signal: the searched image. peak, threshold: (n,), > 0, same unit.
    """
    areas = np.zeros((box.shape[0], N_LEVELS), np.int32)
    level = np.empty(N_LEVELS)
    for i in range(box.shape[0]):
        for k in range(N_LEVELS):
            level[k] = threshold[i] * (peak[i] / threshold[i]) ** (k / N_LEVELS)
        for y in range(box[i, 2], box[i, 3] + 1):
            for x in range(box[i, 0], box[i, 1] + 1):
                if segments[y, x] == i + 1:
                    for k in range(N_LEVELS):
                        if signal[y, x] <= level[k]:
                            break
                        areas[i, k] += 1
    return areas
