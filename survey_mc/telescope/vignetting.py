"""Vignetting of the telescopes: the chance that a photon from an off-axis angle is observed.

Idea     quartic in off-axis angle, one per band, 1 on axis; applied once, to source and background photons alike.
Source   EPIC: paper Sect. 2 (53 % soft, 48 % hard at 10′); between and beyond, a quartic fit of 1/(1 + (θ/θ₀)²)
         through those points, within 0.003 of it to 15′, because the paper does not print its coefficients. The other
         instruments: their files.
Limits   azimuthally symmetric; known to 15′ at most: asking beyond is an error.
"""

from __future__ import annotations

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.types import FloatArray

VALID_ARCMIN = 15.0
UNIT_ARCMIN = 10.0  # coefficients multiply powers of θ/10′
_ROUNDING = 1e-9

Coefficients = tuple[float, float, float, float]
NO_VIGNETTING: Coefficients = (0.0, 0.0, 0.0, 0.0)


def vignetting(offaxis_arcmin: FloatArray, coefficients: Coefficients) -> FloatArray:
    """1 + c₁x + c₂x² + c₃x³ + c₄x⁴ with x = θ/10′; raises BadInput beyond 15′."""
    x = np.asarray(offaxis_arcmin, dtype=np.float64) / UNIT_ARCMIN
    if np.any(x > VALID_ARCMIN / UNIT_ARCMIN + _ROUNDING):
        raise BadInput("vignetting", f"known to {VALID_ARCMIN:g}′ off axis (asked for {10 * np.max(x):.2f}′)")
    c1, c2, c3, c4 = coefficients
    return np.asarray(1.0 + x * (c1 + x * (c2 + x * (c3 + x * c4))))


def held_vignetting(offaxis_arcmin: FloatArray, coefficients: Coefficients) -> FloatArray:
    """`vignetting` to 15′ and its value there beyond: for images whose corners are not cut by the field of view."""
    return vignetting(np.minimum(offaxis_arcmin, VALID_ARCMIN), coefficients)


def check_coefficients(where: str, coefficients: Coefficients) -> None:
    """Raise BadInput unless the quartic is a probability from the axis to 15′."""
    values = vignetting(np.linspace(0.0, VALID_ARCMIN, 301), coefficients)
    if values.min() < 0.0 or values.max() > 1.0 + _ROUNDING:
        raise BadInput(
            where,
            f"1 + c1 x + c2 x² + c3 x³ + c4 x⁴ (x = θ/10′) must stay within 0..1 to {VALID_ARCMIN:g}′ "
            f"(got {values.min():.3g}..{values.max():.3g})",
        )
