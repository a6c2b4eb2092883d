"""The inner loops of drawing a field, photon by photon.

Idea     Poisson process over pixels: arrival levels of a unit Poisson process run along the accumulated expectation of
         the pixels in row-major order; what is left of a level inside its pixel is a uniform x, already ascending.
         King radius: with E exponential, r² = r_c² (exp(E/(α−1)) − 1), no power needed.
Limits   results depend on the order of the random numbers: changing a loop here changes every field.
         Random numbers and arithmetic are kept in separate loops because the processor overlaps the latter only.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.types import BoolArray, FloatArray, FloatImage, IntArray

BELOW_ONE = 1.0 - 1e-12  # a position inside a pixel must not round up into the next one
_QUARTER_TURN = 0.5 * math.pi


@njit(cache=True)
def arrivals(rng: np.random.Generator, total: float, capacity: int) -> tuple[FloatArray, FloatArray]:
    """Arrivals of a unit Poisson process on (0, total) in ascending order, and a uniform number for each.

    capacity: the most that is returned; as many as that may mean that some are missing.
    """
    levels = np.empty(capacity)
    heights = np.empty(capacity)
    n = 0
    level = rng.standard_exponential()
    while level < total and n < capacity:
        levels[n] = level
        heights[n] = min(rng.random(), BELOW_ONE)
        level += rng.standard_exponential()
        n += 1
    return levels[:n], heights[:n]


@njit(cache=True)
def place_in_pixels(expected: FloatImage, levels: FloatArray, heights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions x, y (pixels) of the arrivals of a process that runs along the expected counts of an image."""
    ny, nx = expected.shape
    x_pix = np.empty(levels.size)
    y_pix = np.empty(levels.size)
    n = 0
    edge = 0.0
    for row in range(ny):
        for column in range(nx):
            mean = expected[row, column]
            while n < levels.size and levels[n] < edge + mean:
                x_pix[n] = column - 0.5 + min((levels[n] - edge) / mean, BELOW_ONE)
                y_pix[n] = row - 0.5 + heights[n]
                n += 1
            edge += mean
    return x_pix[:n], y_pix[:n]


@njit(cache=True)
def king_offsets(
    rng: np.random.Generator, n: int, core_radius: float, inverse_slope: float
) -> tuple[FloatArray, FloatArray]:
    """n random offsets dx, dy from a King profile, in the unit of its core radius; inverse_slope is 1/(α − 1).

    The direction is a random quarter turn plus an angle within ±45°, whose series are exact to 1e-11.
    """
    dx = np.empty(n)
    dy = np.empty(n)
    for i in range(n):
        dx[i] = rng.standard_exponential()
        dy[i] = rng.random()
    for i in range(n):
        dx[i] = core_radius * math.sqrt(math.exp(dx[i] * inverse_slope) - 1.0)
    for i in range(n):
        radius = dx[i]
        turns = 4.0 * dy[i]
        quarter = np.floor(turns)
        angle = (turns - quarter - 0.5) * _QUARTER_TURN
        a2 = angle * angle
        sine = 1.0 + a2 * (-1 / 6 + a2 * (1 / 120 + a2 * (-1 / 5040 + a2 * (1 / 362880 - a2 / 39916800))))
        sine *= angle
        cosine = a2 * (1 / 24 + a2 * (-1 / 720 + a2 * (1 / 40320 + a2 * (-1 / 3628800 + a2 / 479001600))))
        cosine = 1.0 + a2 * (-0.5 + cosine)
        half = np.floor(0.5 * quarter)
        is_odd = quarter - 2.0 * half
        radius *= 1.0 - 2.0 * half
        dx[i] = radius * (cosine * (1.0 - is_odd) - sine * is_odd)
        dy[i] = radius * (sine * (1.0 - is_odd) + cosine * is_odd)
    return dx, dy


@njit(cache=True)
def _transmission(x: float, y: float, vignetting: FloatArray, valid_arcmin: float, fov_arcmin: float) -> float:
    """Chance that a photon from this direction (arcsec) is observed."""
    offaxis_arcmin: float = math.sqrt(x * x + y * y) / 60.0
    if not offaxis_arcmin <= fov_arcmin:
        return 0.0
    t = min(offaxis_arcmin, valid_arcmin) / 10.0
    return float(1.0 + t * (vignetting[0] + t * (vignetting[1] + t * (vignetting[2] + t * vignetting[3]))))


@njit(cache=True)
def source_directions(
    rng: np.random.Generator,
    sources: FloatArray,
    n_photons: NDArray[np.int64],
    vignetting: FloatArray,
    valid_arcmin: float,
    fov_arcmin: float,
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Sky directions x, y (arcsec) of the observed photons of point and β-model sources, and the source's number.

    sources: (n, 5) x, y (arcsec), on-axis counts, core radius (arcsec, 0 for a point), 1/(3β − 1.5). n_photons: (n,)
    photons of each source; those of a point are already thinned by its transmission, those of a β-model are not.
    """
    total = 0
    for i in range(sources.shape[0]):
        total += n_photons[i]
    x_arcsec = np.empty(total)
    y_arcsec = np.empty(x_arcsec.size)
    number = np.empty(x_arcsec.size, np.int32)
    n = 0
    for i in range(sources.shape[0]):
        x, y = sources[i, 0], sources[i, 1]
        if sources[i, 3] == 0.0:
            for k in range(n, n + n_photons[i]):
                x_arcsec[k] = x
                y_arcsec[k] = y
                number[k] = i
            n += n_photons[i]
        else:
            dx, dy = king_offsets(rng, n_photons[i], sources[i, 3], sources[i, 4])
            for k in range(n_photons[i]):
                if rng.random() < _transmission(x + dx[k], y + dy[k], vignetting, valid_arcmin, fov_arcmin):
                    x_arcsec[n] = x + dx[k]
                    y_arcsec[n] = y + dy[k]
                    number[n] = i
                    n += 1
    return x_arcsec[:n], y_arcsec[:n], number[:n]


@njit(cache=True)
def thinned(
    rng: np.random.Generator,
    x_arcsec: FloatArray,
    y_arcsec: FloatArray,
    vignetting: FloatArray,
    valid_arcmin: float,
    fov_arcmin: float,
) -> BoolArray:
    """Which photons from these sky directions are observed."""
    kept = np.empty(x_arcsec.size, np.bool_)
    for i in range(x_arcsec.size):
        kept[i] = rng.random() < _transmission(x_arcsec[i], y_arcsec[i], vignetting, valid_arcmin, fov_arcmin)
    return kept


@njit(cache=True)
def on_detector(
    x_arcsec: FloatArray,
    y_arcsec: FloatArray,
    number: IntArray,
    dx_arcsec: FloatArray,
    dy_arcsec: FloatArray,
    scale_arcsec: float,
    x_axis_pix: float,
    y_axis_pix: float,
    in_view: BoolArray,
) -> FloatArray:
    """Photons (n, 3) x, y (pixels) and origin of the directions plus offsets that fall on an observed pixel."""
    ny, nx = in_view.shape
    photons = np.empty((x_arcsec.size, 3))
    n = 0
    for i in range(x_arcsec.size):
        x = (x_arcsec[i] + dx_arcsec[i]) / scale_arcsec + x_axis_pix
        y = (y_arcsec[i] + dy_arcsec[i]) / scale_arcsec + y_axis_pix
        if -0.5 <= x < nx - 0.5 and -0.5 <= y < ny - 0.5 and in_view[int(y + 0.5), int(x + 0.5)]:
            photons[n, 0] = x
            photons[n, 1] = y
            photons[n, 2] = number[i]
            n += 1
    return photons[:n]
