"""The β-model of a cluster of galaxies.

Idea     surface brightness ∝ [1 + (r/r_c)²]^(−3β + ½): a King profile of slope 3β − ½.
Source   Cavaliere & Fusco-Femiano 1976, A&A 49, 137; paper Sect. 2 (β = 0.75).
Limits   circular, not truncated: 3 % of the photons lie beyond 10 r_c for β = 0.75. Needs β > ½.
"""

from __future__ import annotations

import numpy as np

from survey_mc.telescope.psf import KingPsf
from survey_mc.types import FloatArray

N_RADII = 64
N_ANGLES = 64


def beta_profile(core_radius_arcsec: float, beta: float) -> KingPsf:
    """The profile as a King law: encircled fraction, surface brightness and their inverse come with it."""
    return KingPsf(3.0 * beta - 0.5, core_radius_arcsec)


def profile_directions(core_radius_arcsec: float, beta: float) -> tuple[FloatArray, FloatArray]:
    """Offsets (dx, dy; arcsec) of 64 × 64 directions, each with the same part of the photons.

    A mean over them is a mean over the source: midpoint rule in encircled fraction and azimuth, good to 1e-3.
    """
    fraction = (np.arange(N_RADII) + 0.5) / N_RADII
    angle = 2.0 * np.pi * (np.arange(N_ANGLES) + 0.5) / N_ANGLES
    radius_arcsec = beta_profile(core_radius_arcsec, beta).radius_of_fraction(fraction)
    return np.outer(radius_arcsec, np.cos(angle)).ravel(), np.outer(radius_arcsec, np.sin(angle)).ravel()
