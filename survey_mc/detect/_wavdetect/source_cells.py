"""Source cells: the hills of a flux image, bounded by the saddles between them and by its zero level.

Idea     from every pixel one climbs to the highest of its eight neighbours until a local maximum is reached. All pixels
         that end on one maximum are its hill; the border of two hills runs through their saddle. A descending flood, in
         which every pixel joins its highest wet neighbour, gives the same hills.
Source   Freeman et al. 2002, ApJS 138, 185, Sect. 4 for the source cell; watershed by steepest ascent (textbook).
Limits   equal heights are ordered by pixel number. On noise a hill is as wide as the smoothing: an extended source
         falls apart into hills of that width.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Image = NDArray[np.float32]
Labels = NDArray[np.int32]
Values = NDArray[np.float64]

SUBSAMPLES = 5  # per pixel side
TOUCHES_EDGE, TOUCHES_SOURCE = 1, 2
N_SUMS = 12
SUM_PIXELS, SUM_PHOTONS, SUM_BACKGROUND, SUM_X, SUM_Y, SUM_XX, SUM_YY, SUM_XY, SUM_BX, SUM_BY, SUM_PX, SUM_PY = range(
    N_SUMS
)


@njit(cache=True)
def hill_tops(flux: Image) -> Labels:
    """Flat index of the maximum that each pixel climbs to, (ny·nx,); −inf marks pixels that belong to no hill (−1)."""
    height, width = flux.shape
    framed = np.full((height + 2, width + 2), np.float32(-np.inf), np.float32)
    for y in range(height):
        for x in range(width):
            framed[y + 1, x + 1] = flux[y, x]
    top = np.empty(height * width, np.int32)
    for y in range(height):
        above, level, below = framed[y], framed[y + 1], framed[y + 2]
        for x in range(width):
            best, at = above[x], (y - 1) * width + x - 1
            # Strictly higher only: of equal neighbours the first counts.
            if above[x + 1] > best:
                best, at = above[x + 1], (y - 1) * width + x
            if above[x + 2] > best:
                best, at = above[x + 2], (y - 1) * width + x + 1
            for k in range(3):
                if level[x + k] > best:
                    best, at = level[x + k], y * width + x + k - 1
            for k in range(3):
                if below[x + k] > best:
                    best, at = below[x + k], (y + 1) * width + x + k - 1
            top[y * width + x] = at if level[x + 1] > -np.inf else -1
    for i in range(top.shape[0]):
        root = top[i]
        while root >= 0 and top[root] != root:
            root = top[root]
        j = i
        while j >= 0 and top[j] != root:
            after = top[j]
            top[j] = root
            j = after
    return top


def cell_owners(flux: Image, top: Labels, roots: Labels, floor: float) -> Labels:
    """Number of the source whose cell holds each pixel, (ny, nx); −1: none. roots: hill top of each source."""
    source = np.full(top.shape[0], -1, dtype=np.int32)
    source[roots] = np.arange(len(roots), dtype=np.int32)
    return np.where(flux > floor, source[top].reshape(flux.shape), np.int32(-1))


@njit(cache=True)
def cell_sums(owner: Labels, photons: Image, background: Image, flux: Image, peak: Values) -> tuple[Values, Labels]:
    """Sums over each cell, (n, N_SUMS), with moments about its peak, and TOUCHES bits.

    peak: (n, 2) x, y. flux: −inf where nothing is observed.
    """
    height, width = owner.shape
    sums = np.zeros((peak.shape[0], N_SUMS))
    touches = np.zeros(peak.shape[0], np.int32)
    for y in range(height):
        for x in range(width):
            i = owner[y, x]
            if i < 0:
                continue
            light, dx, dy = float(photons[y, x]), x - peak[i, 0], y - peak[i, 1]
            sums[i, SUM_PIXELS] += 1.0
            sums[i, SUM_PHOTONS] += light
            sums[i, SUM_BACKGROUND] += background[y, x]
            sums[i, SUM_X] += light * dx
            sums[i, SUM_Y] += light * dy
            sums[i, SUM_XX] += light * dx * dx
            sums[i, SUM_YY] += light * dy * dy
            sums[i, SUM_XY] += light * dx * dy
            sums[i, SUM_BX] += background[y, x] * dx
            sums[i, SUM_BY] += background[y, x] * dy
            sums[i, SUM_PX] += dx
            sums[i, SUM_PY] += dy
            if x == 0 or y == 0 or x == width - 1 or y == height - 1:
                touches[i] |= TOUCHES_EDGE
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    if flux[v, u] == -np.inf:
                        touches[i] |= TOUCHES_EDGE
                    elif owner[v, u] >= 0 and owner[v, u] != i:
                        touches[i] |= TOUCHES_SOURCE
    return sums, touches


@njit(cache=True)
def lever_sums(owner: Labels, photons: Image, centre: Values) -> Values:
    """Σ D (x − x̄)² and Σ D (y − ȳ)² over each cell and the free pixels that touch it, (n, 2).

    Whether a pixel of the rim belongs to the cell is chance, so its photons count as noise of the centroid too.
    """
    height, width = owner.shape
    sums = np.zeros((centre.shape[0], 2))
    for y in range(height):
        for x in range(width):
            light = float(photons[y, x])
            if light == 0.0:
                continue
            if owner[y, x] >= 0:
                i = owner[y, x]
                sums[i, 0] += light * (x - centre[i, 0]) ** 2
                sums[i, 1] += light * (y - centre[i, 1]) ** 2
                continue
            last = -1  # a free pixel counts once for a cell; of several cells, for those met in ascending order
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    i = owner[v, u]
                    if i > last:
                        sums[i, 0] += light * (x - centre[i, 0]) ** 2
                        sums[i, 1] += light * (y - centre[i, 1]) ** 2
                        last = i
    return sums


@njit(cache=True)
def cell_profiles(
    owner: Labels, photons: Image, background: Image, centre: Values, n_steps: int, step_pix: float
) -> tuple[Values, Values]:
    """Net counts and area (pix²) of each cell in rings of width step_pix about its centre, (n, n_steps) each.

    centre: (n, 2) x, y. Pixels are spread evenly over SUBSAMPLES² points; what lies beyond the last ring is left out.
    """
    height, width = owner.shape
    net, area = np.zeros((centre.shape[0], n_steps)), np.zeros((centre.shape[0], n_steps))
    weight = 1.0 / (SUBSAMPLES * SUBSAMPLES)
    for y in range(height):
        for x in range(width):
            i = owner[y, x]
            if i < 0:
                continue
            light = photons[y, x] - background[y, x]
            for j in range(SUBSAMPLES):
                for k in range(SUBSAMPLES):
                    dx = x - centre[i, 0] + (k + 0.5) / SUBSAMPLES - 0.5
                    dy = y - centre[i, 1] + (j + 0.5) / SUBSAMPLES - 0.5
                    place = int(math.sqrt(dx * dx + dy * dy) / step_pix)
                    if place < n_steps:
                        net[i, place] += weight * light
                        area[i, place] += weight
    return net, area


def half_radii(net: Values, total: Values, step_pix: float) -> Values:
    """Radius (pix) where the growth curve first reaches half of `total`; NaN where total ≤ 0 or it never does."""
    growth = np.cumsum(net, axis=1)
    half = 0.5 * total
    reached = (growth >= half[:, None]) & (total > 0.0)[:, None]
    step = reached.argmax(axis=1)
    row = np.arange(len(net))
    ring = np.where(net[row, step] > 0.0, net[row, step], 1.0)
    radii = (step + 1.0 - (growth[row, step] - half) / ring) * step_pix
    return np.where(reached.any(axis=1), radii, np.nan)
