"""Physical constants and the directions of every conversion.

Idea     counts ↔ rate ↔ flux and angle ↔ pixel are converted here and nowhere else.
Source   paper Tab. 8 and Sect. 8 ("~90 photons" at 6e-16 in 100 ks).
Limits   one conversion factor per band: the spectrum is the one the factor was made for.

Suffixes used in names throughout: `_arcsec`, `_arcmin`, `_deg`, `_pix` (pixels), `_s`, `_ks`, `_kev`,
`_cgs` (erg/cm²/s), `_cps` (counts per second), `_per_pix`, `_per_arcmin2`; bare `counts` are photons.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ARCSEC_PER_ARCMIN = 60.0
ARCMIN_PER_DEG = 60.0
ARCSEC_PER_DEG = 3600.0
SECONDS_PER_KS = 1000.0

Numbers = float | NDArray[np.float64]


def rate_from_flux(flux_cgs: Numbers, flux_per_rate_cgs: float) -> Numbers:
    """On-axis count rate (ct/s) of a flux.

    flux_per_rate_cgs: erg/cm²/s for one ct/s. The paper heads this number "cts/s per flux", but its own check
    (90 photons at 6e-16 in 100 ks) holds only for the inverse: 6e-16 / 6.70e-13 × 1e5 = 89.6.
    """
    return flux_cgs / flux_per_rate_cgs


def flux_from_rate(rate_cps: Numbers, flux_per_rate_cgs: float) -> Numbers:
    """Flux (erg/cm²/s) of an on-axis count rate (ct/s); the inverse of `rate_from_flux`."""
    return rate_cps * flux_per_rate_cgs


def deg2_of_circle(radius_arcmin: float) -> float:
    """Area (deg², flat sky) of a circle; 10′ gives the paper's 0.0873 deg²."""
    return float(np.pi * (radius_arcmin / ARCMIN_PER_DEG) ** 2)
