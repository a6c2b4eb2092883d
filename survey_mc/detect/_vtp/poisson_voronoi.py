"""The flux distribution of Voronoi cells of random points: law, background level, flux cut-off.

Idea     the area of a cell of a flat Poisson process follows nearly a Γ law of index k, so its flux (1 / area) has the
         distribution Q(k, k s/f) around the background level s. The faint cells give level and number; where the number
         of all cells exceeds this law the sources begin.
Source   Ebeling & Wiedenmann 1993 (k = 4, after Kiang 1966); Járai-Szabó & Néda 2007 (k = 7/2); the steps of CIAO's
         `vtpdetect` help page. How its two minima make one cut-off is not documented: here their mean.
Limits   k = 4 and 7/2 are both approximations (a few per cent of the distribution). Cells with several photons, and
         photons in pixel centres when most pixels are occupied, do not follow the law.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincc

from survey_mc.types import FloatArray

FIT_POINTS = 200  # fluxes at which the counted and the expected distribution are compared
LEVEL_SPAN = 50.0  # the level is searched over this factor downwards …
LEVEL_TRIALS = 40  # … first at so many values
CLIP_FLUX = 3.0  # above it 6 % of the cells of a flat sky, and most of those of sources
CLIP_ROUNDS = 50
CLIP_TOLERANCE = 1e-4


def flux_cdf(flux: FloatArray, k: float) -> FloatArray:
    """Probability that a cell of a flat field is fainter than `flux` (units of the mean density)."""
    flux = np.asarray(flux, dtype=np.float64)
    inverse = np.divide(k, flux, out=np.full(flux.shape, np.inf), where=flux > 0.0)
    return np.asarray(gammaincc(k, inverse))


def flat_density(photons: FloatArray, area: FloatArray, k: float) -> float:
    """Photons per area of the flat sky between the sources: of cells fainter than CLIP_FLUX × this density.

    Corrected for the faintness of what the clip leaves of a flat sky, so without sources it is the mean density.
    """
    flux = photons / area
    kept_ratio = float(gammaincc(k, k / CLIP_FLUX) / gammaincc(k + 1.0, k / CLIP_FLUX))
    density = float(photons.sum() / area.sum())
    for _ in range(CLIP_ROUNDS):
        faint = flux < CLIP_FLUX * density
        if not faint.any():
            break
        clipped = float(photons[faint].sum() / area[faint].sum()) / kept_ratio
        if abs(clipped - density) <= CLIP_TOLERANCE * density:
            return clipped
        density = clipped
    return density


def fluxes_up_to(flux_max: float) -> FloatArray:
    """Equally spaced fluxes from one step above 0 to flux_max."""
    return np.asarray(np.arange(1, FIT_POINTS + 1) * (flux_max / FIT_POINTS), dtype=np.float64)


def cells_up_to(flux: FloatArray, grid: FloatArray) -> FloatArray:
    """Number of cells not brighter than each of the equally spaced fluxes of `fluxes_up_to`."""
    place = np.ceil(flux[flux <= grid[-1]] / grid[0] - 1e-9).astype(np.int64)
    return np.cumsum(np.bincount(np.clip(place - 1, 0, len(grid) - 1), minlength=len(grid))).astype(np.float64)


def fit_faint_cells(
    flux: FloatArray, k: float, flux_max: float, level_max: float, tolerance: float
) -> tuple[float, float]:
    """Level and number of the background cells whose law fits best, in squares, the cells fainter than flux_max.

    The number is linear and follows from the level. Without faint cells: level 1 and all cells.
    """
    grid = fluxes_up_to(flux_max)
    counted = cells_up_to(flux, grid)
    if counted[-1] == 0.0:
        return 1.0, float(len(flux))

    def explained(log_level: float) -> tuple[float, float]:
        law = flux_cdf(grid / np.exp(log_level), k)
        norm, product = float(law @ law), float(law @ counted)
        return (product**2 / norm, product / norm) if norm > 0.0 else (0.0, 0.0)

    trials = np.linspace(np.log(level_max / LEVEL_SPAN), np.log(level_max), LEVEL_TRIALS)
    best = int(np.argmax([explained(trial)[0] for trial in trials]))
    low, high = trials[max(best - 1, 0)], trials[min(best + 1, LEVEL_TRIALS - 1)]
    from scipy.optimize import minimize_scalar  # a driver does without

    found = minimize_scalar(
        lambda trial: -explained(trial)[0], bounds=(low, high), method="bounded", options={"xatol": tolerance}
    )
    return float(np.exp(found.x)), explained(float(found.x))[1]


def flux_cutoff(flux: FloatArray, k: float, level: float, number: float, search: tuple[float, float]) -> float:
    """Flux at which the excess of all cells over the law of `number` background cells is least.

    search: range of fluxes. The mean of the absolute minimum and the minimum of a parabola fitted over the range; where
    the parabola has no minimum in the range, the absolute one.
    """
    low, high = search
    grid = fluxes_up_to(high)
    excess = cells_up_to(flux, grid) - number * flux_cdf(grid / level, k)
    inside = grid >= low
    x, y = grid[inside], excess[inside]
    least = float(x[np.argmin(y)])
    middle = 0.5 * (low + high)
    curvature, slope, _ = np.polyfit(x - middle, y, 2) if len(x) > 2 else (0.0, 0.0, 0.0)
    if curvature <= 0.0:
        return least
    bottom = middle - slope / (2.0 * curvature)
    return 0.5 * (least + float(np.clip(bottom, low, high)))
