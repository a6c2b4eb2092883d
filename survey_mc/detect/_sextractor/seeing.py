"""How wide a point source is in a filtered image: the "seeing" of the stellarity index.

Idea     a photon at radius ρ of the PSF, displaced by a circular Gaussian of standard deviation σ, lands at r with the
         density exp(−(r−ρ)²/2σ²) · e^{−x} I₀(x) / 2πσ², x = rρ/σ². Summed over the PSF this is the profile of a point;
         its full width at half maximum is read off.
Source   paper Sect. 3.5 (the seeing is tuned to the mean PSF size); Rice 1945 for the density.
Limits   the filter is a Gaussian. For the paper's PSF, whose wings are wide, the sum in quadrature of the widths of the
         PSF and of a 12″ Gaussian (13.4″) is too small: it is 16.6″ on images of 4″ pixels, and
         15.9″ by this file.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import i0e

from survey_mc.types import Psf

PIXEL_VARIANCE_PIX = 1.0 / 12.0  # of a position that is known to a pixel
LARGEST_RADIUS_ARCSEC = 1800.0
SMALLEST_RADIUS_ARCSEC = 0.01
N_PSF_RADII = 120
N_RADII = 48


def smoothed_fwhm_arcsec(psf: Psf, sigma_pix: float, scale_arcsec: float) -> float:
    """FWHM of a point source whose image in pixels of `scale_arcsec` was smoothed by a Gaussian of `sigma_pix`."""
    sigma = scale_arcsec * math.sqrt(sigma_pix**2 + PIXEL_VARIANCE_PIX)
    edges = np.concatenate([[0.0], np.geomspace(SMALLEST_RADIUS_ARCSEC, LARGEST_RADIUS_ARCSEC, N_PSF_RADII)])
    share = np.diff(psf.encircled_energy(edges))
    photon = 0.5 * (edges[1:] + edges[:-1])
    # A half maximum is nearer than the sum of the half-light radius of the PSF and of 3σ.
    radius = np.linspace(0.0, 0.5 * psf.hew_arcsec + 3.0 * sigma, N_RADII)[:, None]
    profile = (np.exp(-0.5 * np.square((radius - photon) / sigma)) * i0e(radius * photon / sigma**2)) @ share
    return float(2.0 * max(np.interp(-0.5 * profile[0], -profile, radius[:, 0]), SMALLEST_RADIUS_ARCSEC))
