"""Encircled energy of the believed PSF after smoothing, for aperture corrections of point sources.

Idea     a photon at radius r, displaced by a circular Gaussian of standard deviation σ, stays inside R with the
         probability of a non-central χ² of two degrees: EE_σ(R) = Σ ΔEE(r) · P(χ²₂(r²/σ²) ≤ R²/σ²).
Limits   circular apertures of equal area; point sources; a tail of the PSF beyond 30′ is taken as lost.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chndtr

from survey_mc.types import FloatArray, Psf

LARGEST_RADIUS_ARCSEC = 1800.0
SMALLEST_RADIUS_ARCSEC = 0.05
N_RADII = 240
N_APERTURES = 64
LEAST_FRACTION = 1e-6  # what an aperture far smaller than the PSF is taken to hold, rather than nothing
FAR_SIGMA = 8.0  # a photon farther from the aperture's edge than this does not cross it


def smoothed_encircled_energy(radius_arcsec: FloatArray, psf: Psf, sigma_arcsec: float) -> FloatArray:
    """Fraction of a point source's photons inside circles, after smoothing by a Gaussian (0: none)."""
    radius = np.asarray(radius_arcsec, dtype=np.float64)
    if sigma_arcsec <= 0.0:
        return np.asarray(psf.encircled_energy(radius), dtype=np.float64)
    edges = np.concatenate([[0.0], np.geomspace(SMALLEST_RADIUS_ARCSEC, LARGEST_RADIUS_ARCSEC, N_RADII)])
    share = np.diff(psf.encircled_energy(edges))
    photon = 0.5 * (edges[1:] + edges[:-1])
    distance = (radius[..., None] - photon) / sigma_arcsec
    near = np.abs(distance) < FAR_SIGMA
    inside = (distance > 0.0).astype(np.float64)
    aperture, centre = np.broadcast_arrays(radius[..., None] / sigma_arcsec, photon / sigma_arcsec)
    inside[near] = chndtr(np.square(aperture[near]), 2.0, np.square(centre[near]))
    return np.asarray(inside @ share)


def aperture_fraction(radius_arcsec: FloatArray, psf: Psf, sigma_arcsec: float) -> FloatArray:
    """`smoothed_encircled_energy` interpolated in a table that spans the given radii (arcsec, > 0)."""
    if radius_arcsec.size == 0:
        return np.ones(0)
    table = np.geomspace(radius_arcsec.min(), radius_arcsec.max() * (1.0 + 1e-9), N_APERTURES)
    fraction = smoothed_encircled_energy(table, psf, sigma_arcsec)
    return np.interp(radius_arcsec, table, np.maximum(fraction, LEAST_FRACTION))
