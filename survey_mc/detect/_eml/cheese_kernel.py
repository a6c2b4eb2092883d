"""Compiled loop of the cheese image: circles cut out, the rest summed in cells.

Idea     one pass over the circles and one over the image, without temporary images.
Source   none: arithmetic.
Limits   a pixel is cut when its centre lies inside a circle.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

COUNTS, EXPOSURE, AREA = range(3)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def cheese_cells(
    counts: NDArray[np.int32],
    exposure: NDArray[np.float64],
    circles: NDArray[np.float64],
    edges_y: NDArray[np.int64],
    edges_x: NDArray[np.int64],
    left: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """(3, n_y, n_x): counts, exposure and pixels of the cells outside the circles; clears `left` inside them.

    circles: (n, 3) x, y, radius (pix). edges: first pixels of the cells and the size of the image. left: True where
    observed.
    """
    height, width = counts.shape
    for i in range(circles.shape[0]):
        x, y, radius = circles[i, 0], circles[i, 1], circles[i, 2]
        for row in range(max(math.ceil(y - radius), 0), min(math.floor(y + radius) + 1, height)):
            for column in range(max(math.ceil(x - radius), 0), min(math.floor(x + radius) + 1, width)):
                if (row - y) * (row - y) + (column - x) * (column - x) < radius * radius:
                    left[row, column] = False
    cells = np.zeros((3, edges_y.shape[0] - 1, edges_x.shape[0] - 1))
    for cell_y in range(edges_y.shape[0] - 1):
        for row in range(edges_y[cell_y], edges_y[cell_y + 1]):
            for cell_x in range(edges_x.shape[0] - 1):
                photons, seconds, pixels = 0, 0.0, 0
                for column in range(edges_x[cell_x], edges_x[cell_x + 1]):
                    if left[row, column]:
                        photons += counts[row, column]
                        seconds += exposure[row, column]
                        pixels += 1
                cells[COUNTS, cell_y, cell_x] += photons
                cells[EXPOSURE, cell_y, cell_x] += seconds
                cells[AREA, cell_y, cell_x] += pixels
    return cells
