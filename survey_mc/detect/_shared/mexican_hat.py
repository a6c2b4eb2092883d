"""The Mexican-hat wavelet on pixels.

Idea     W(r; σ) = (2 − r²/σ²) exp(−r²/2σ²): positive core, negative ring, zero integral. A Gaussian source of N counts
         and width p has W⋆D = 2Nσ⁴/(p² + σ²)² at its centre; flat sky of b counts per pixel has variance 2πσ²b.
Source   Freeman et al. 2002, ApJS 138, 185 (normalisation W(0) = 2); Damiani et al. 1997, ApJ 483, 350, use W/2πσ².
Limits   sampled at pixel centres, cut at 5σ; the small residual sum is spread evenly so that Σ W = 0 exactly.
"""

from __future__ import annotations

import math

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.types import FloatImage

REACH_SIGMA = 5.0


def half_size_pix(sigma_pix: float) -> int:
    """Half-size of the kernel's stamp."""
    return math.ceil(REACH_SIGMA * sigma_pix)


@bounded_cache(64)
def mexican_hat(sigma_pix: float) -> FloatImage:
    """(2h + 1)² kernel, unnormalised, Σ W = 0; read-only."""
    half = half_size_pix(sigma_pix)
    offset = np.arange(-half, half + 1) / sigma_pix
    r2 = np.square(offset)[:, None] + np.square(offset)
    inside = r2 <= REACH_SIGMA**2
    values = np.where(inside, (2.0 - r2) * np.exp(-0.5 * r2), 0.0)
    values[inside] -= values.sum() / inside.sum()
    values.setflags(write=False)
    return values


def negative_part(kernel: FloatImage) -> FloatImage:
    """min(W, 0): the ring that measures the background."""
    return np.minimum(kernel, 0.0)
