"""Gaussian smoothing of a photon image that is not observed everywhere.

Idea     normalised convolution: smoothed counts over smoothed weights, so neither the image border nor a mask pulls the
         smoothed image down. Where part of the kernel is missing the noise grows by a known factor.
Source   paper Sect. 3.4 (FWHM 12″ and 20″); Knutsson & Westin 1993 for the normalisation.
Limits   the kernel is cut at 4σ; sigma below ~0.5 pix is undersampled.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from survey_mc.caches import bounded_cache
from survey_mc.types import BoolArray, FloatArray, FloatImage

SIGMA_PER_FWHM = 1.0 / math.sqrt(8.0 * math.log(2.0))
TRUNCATE_SIGMA = 4.0
LEAST_COVERAGE = 1e-6  # below it nothing of the kernel is observed


def sigma_pix_from_fwhm(fwhm_arcsec: float, scale_arcsec: float) -> float:
    """Standard deviation (pix) of a Gaussian of the given full width at half maximum."""
    return fwhm_arcsec * SIGMA_PER_FWHM / scale_arcsec


@bounded_cache(32)
def gaussian_profile(sigma_pix: float) -> FloatArray:
    """Sampled, unit-sum Gaussian along one axis, read-only."""
    half = int(TRUNCATE_SIGMA * sigma_pix + 0.5)
    offset = np.arange(-half, half + 1)
    profile = np.exp(-0.5 * np.square(offset / sigma_pix))
    profile /= profile.sum()
    profile.setflags(write=False)
    return profile


def gaussian_kernel(sigma_pix: float) -> FloatArray:
    """Two-dimensional unit-sum kernel."""
    profile = gaussian_profile(sigma_pix)
    return np.outer(profile, profile)


def noise_norm(sigma_pix: float) -> float:
    """√Σw²: noise of a smoothed flat field in units of √b."""
    return float(np.square(gaussian_profile(sigma_pix)).sum())


def peak_per_count(sigma_pix: float) -> float:
    """Peak of the smoothed image of one photon."""
    return float(gaussian_profile(sigma_pix).max() ** 2)


def smooth(values: FloatImage, sigma_pix: float) -> FloatImage:
    """Plain convolution, zero outside the image."""
    return np.asarray(gaussian_filter(values, sigma_pix, mode="constant", truncate=TRUNCATE_SIGMA))


def smooth_weight(weight: FloatImage, sigma_pix: float) -> FloatImage:
    """Smoothed weights; an outer product of two profiles when all weights are 1."""
    if np.all(weight == 1.0):
        along = [
            gaussian_filter1d(np.ones(n), sigma_pix, mode="constant", truncate=TRUNCATE_SIGMA) for n in weight.shape
        ]
        return np.outer(along[0], along[1])
    seen = weight > 0.0
    if np.array_equal(seen, weight):
        return _smoothed_mask(seen.tobytes(), weight.shape, sigma_pix)
    return smooth(weight, sigma_pix)


@bounded_cache(4)
def _smoothed_mask(mask: bytes, shape: tuple[int, int], sigma_pix: float) -> FloatImage:
    """Smoothed image of 0 and 1; the fields of a campaign share their mask, so the last are kept. Read-only."""
    smoothed = smooth(np.frombuffer(mask, dtype=np.bool_).reshape(shape).astype(np.float64), sigma_pix)
    smoothed.setflags(write=False)
    return smoothed


def normalised_smoothing(counts: FloatImage, weight: FloatImage, sigma_pix: float) -> FloatImage:
    """Smoothed counts over smoothed weight; 0 where no weight is in reach.

    weight: 0 = not observed, 1 = observed, or the relative exposure, which makes the result exposure-corrected.
    """
    coverage = smooth_weight(weight, sigma_pix)
    seen = np.where(weight > 0.0, counts, 0.0)
    return np.divide(smooth(seen, sigma_pix), coverage, out=np.zeros(counts.shape), where=coverage > LEAST_COVERAGE)


def edge_noise_factor(observed: BoolArray, sigma_pix: float) -> FloatImage:
    """Noise of the normalised smoothing relative to a fully observed surrounding: 1 inside, larger along edges."""
    weight = observed.astype(np.float64)
    # The square of a Gaussian kernel is a Gaussian kernel narrower by √2 of sum noise_norm².
    squared = smooth_weight(weight, sigma_pix / math.sqrt(2.0))
    coverage = smooth_weight(weight, sigma_pix)
    factor = np.divide(np.sqrt(squared), coverage, out=np.ones(observed.shape), where=coverage > LEAST_COVERAGE)
    return np.maximum(factor, 1.0)
