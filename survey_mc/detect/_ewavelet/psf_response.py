"""What the Mexican hat makes of a point source: 4πσ²C per photon of the believed PSF.

Idea     averaged over where in its pixel the source lies, a photon at distance d from it falls into the pixels around
         d with the weights of a linear interpolation; so the mean answer is the hat, linearly interpolated and averaged
         over the photons' distances (from the encircled energy) and directions.
Source   the "simple correction" of the paper, Sect. 4 (Test 1), in tabulated form.
Limits   C at the pixel of the source; circular PSF; photons beyond 30′ count as lost.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from survey_mc.caches import bounded_cache
from survey_mc.detect._shared.mexican_hat import mexican_hat
from survey_mc.types import FloatArray, Psf

SMALLEST_RADIUS_ARCSEC, LARGEST_RADIUS_ARCSEC = 0.01, 1800.0
N_RADII, N_ANGLES = 400, 48


@bounded_cache(64)
def _response(share: bytes, scale_arcsec: float, sigma_pix: float) -> float:
    edges = radius_edges_arcsec()
    radius_pix = 0.5 * (edges[1:] + edges[:-1]) / scale_arcsec
    hat = mexican_hat(sigma_pix)
    half = hat.shape[0] // 2
    near = radius_pix < half + 1.0
    angle = (np.arange(N_ANGLES) + 0.5) * (2.0 * np.pi / N_ANGLES)
    place = radius_pix[near, None] * np.stack([np.sin(angle), np.cos(angle)])[:, None, :] + half
    answer = map_coordinates(hat, place, order=1, mode="constant").mean(axis=1)
    return float(2.0 * answer @ np.frombuffer(share)[near])


def radius_edges_arcsec() -> FloatArray:
    """Edges of the rings that hold the photons."""
    rings = np.geomspace(SMALLEST_RADIUS_ARCSEC, LARGEST_RADIUS_ARCSEC, N_RADII)
    return np.concatenate([[0.0], rings])


def counts_per_photon(psf: Psf, scale_arcsec: float, sigma_pix: float) -> float:
    """4πσ²C / N of a point source on pixels of `scale_arcsec`, mean over its place in the pixel."""
    share = np.diff(np.asarray(psf.encircled_energy(radius_edges_arcsec()), dtype=np.float64))
    return _response(share.tobytes(), scale_arcsec, sigma_pix)
