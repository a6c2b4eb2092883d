"""Detection threshold of the Mexican hat on a flat Poisson sky, in closed form and exact.

Idea     with q = 2πσ²b expected photons in the core of the hat, a maximum of k sigma has
         W⋆D = k√q − 0.2336 + 0.0354k + 0.1830k²: a Gaussian term and what the skewness of few photons adds. Solved for
         k it gives every maximum a significance that means the same at all scales and backgrounds.
Source   Damiani et al. 1997, ApJ 483, 350 (fit to simulations; W⋆D is 2πσ² times their normalisation).
         Exact alternative: distribution of a linear filter on Poisson noise (`_shared.exact_threshold`).
Limits   fitted for log q < 3.25; within 1 % of the exact threshold for σ ≥ 2 pix and q > 4, and 3 % low at σ = 1 pix,
         where the hat hardly fits on pixels. The background is taken as known.
"""

from __future__ import annotations

import math

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.detect._shared.exact_threshold import filter_threshold
from survey_mc.detect._shared.mexican_hat import mexican_hat
from survey_mc.types import FloatArray

CONSTANT, LINEAR, QUADRATIC = -0.2336, 0.0354, 0.1830  # Damiani et al. 1997: skewness term, polynomial in k
STEPS_PER_OCTAVE = 4  # exact thresholds are tabulated at b = 2^(step/4) and interpolated
FIRST_STEP = -48  # b = 2^−12: below it a few photons anywhere are beyond any threshold


def core_photons(background_per_pix: FloatArray, sigma_pix: float) -> FloatArray:
    """q = 2πσ²b: background photons in the effective area of the hat."""
    return np.asarray(2.0 * math.pi * sigma_pix**2 * background_per_pix)


def damiani_threshold(background_per_pix: FloatArray, sigma_pix: float, k_sigma: float) -> FloatArray:
    """Threshold of W⋆D (hat with W(0) = 2) for k sigma on b counts per pixel."""
    skewness = CONSTANT + LINEAR * k_sigma + QUADRATIC * k_sigma**2
    return np.asarray(k_sigma * np.sqrt(core_photons(background_per_pix, sigma_pix)) + skewness)


def equivalent_sigma(
    correlation: FloatArray, background_per_pix: FloatArray, sigma_pix: float | FloatArray
) -> FloatArray:
    """k at which `damiani_threshold` equals W⋆D; negative correlations count as 0."""
    root_q = math.sqrt(2.0 * math.pi) * sigma_pix * np.sqrt(background_per_pix)
    linear = LINEAR + root_q
    square = np.square(linear) + 4.0 * QUADRATIC * (np.maximum(correlation, 0.0) - CONSTANT)
    return np.asarray((np.sqrt(square) - linear) / (2.0 * QUADRATIC))


@bounded_cache(2048)
def _exact_at_step(sigma_pix: float, step: int, false_alarm: float) -> float:
    """Exact threshold of W⋆D at b = 2^(step / STEPS_PER_OCTAVE)."""
    return filter_threshold(mexican_hat(sigma_pix), 2.0 ** (step / STEPS_PER_OCTAVE), false_alarm)


def exact_threshold(background_per_pix: FloatArray, sigma_pix: float, false_alarm: float) -> FloatArray:
    """Threshold of W⋆D exceeded by chance with probability `false_alarm` per pixel, for each background (> 0)."""
    if background_per_pix.size == 0:
        return np.zeros(background_per_pix.shape)
    place = np.maximum(np.log2(background_per_pix) * STEPS_PER_OCTAVE, FIRST_STEP)
    steps = np.arange(math.floor(place.min()), math.ceil(place.max()) + 1)
    table = [_exact_at_step(sigma_pix, int(step), false_alarm) for step in steps]
    return np.asarray(np.interp(place, steps, table))
