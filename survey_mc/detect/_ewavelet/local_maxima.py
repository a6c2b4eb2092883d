"""Pixels that are not exceeded by any of their eight neighbours.

Idea     a pixel is a maximum if it is larger than the neighbours before it in row-major order and not smaller than
         those after it: of equal neighbours the first alone counts, whatever the machine.
Limits   beyond the image counts as −∞, and so should pixels that are not to be analysed.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def local_maxima(image: NDArray[np.float32], floor: np.float32) -> NDArray[np.int64]:
    """(n, 2) row and column of the 3 × 3 maxima above `floor`, in row-major order."""
    height, width = image.shape
    found = np.empty((height * width, 2), np.int64)
    n = 0
    for y in range(height):
        row = image[y]
        for x in range(width):
            value = row[x]
            if not value > floor:
                continue
            if (x > 0 and row[x - 1] >= value) or (x + 1 < width and row[x + 1] > value):
                continue
            is_maximum = True
            for column in range(max(x - 1, 0), min(x + 2, width)):
                before = y > 0 and image[y - 1, column] >= value
                after = y + 1 < height and image[y + 1, column] > value
                if before or after:
                    is_maximum = False
                    break
            if is_maximum:
                found[n, 0], found[n, 1] = y, x
                n += 1
    return found[:n].copy()
