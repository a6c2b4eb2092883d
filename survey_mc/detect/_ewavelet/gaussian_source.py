"""What the Mexican hat sees of a Gaussian source, and how well.

Idea     N photons spread with standard deviation a give C = Nσ²/[π(a² + σ²)²] at their centre. C is largest at σ = a,
         where N = 4πσ²C; the ratio of C at two scales gives a. Photon noise of C, of the ratio and of the place of the
         maximum follow by integrating W², W₁W₂ and (∂W/∂x)² over source and background.
Source   Damiani et al. 1997, ApJ 483, 350 (normalisation C = W⋆D / 2πσ², W(0) = 2); closed forms integrated by us.
Limits   circular Gaussians on a flat sky of b counts per pixel, scales large against a pixel; lengths in pixels.
"""

from __future__ import annotations

import math

import numpy as np

from survey_mc.types import FloatArray

PI = math.pi
PHASE_SPREAD_PIX2 = math.sqrt(1.0 / 90.0)  # standard deviation of r² for a source anywhere in its unit pixel
FOURTH_ORDER = 0.375  # of the peak 2 − 2t + ¾t², t = r²/(a² + σ²): ratio of the coefficients of t² and t


def peak_correlation(counts: FloatArray, width: FloatArray, sigma: FloatArray) -> FloatArray:
    """C at the centre of a source of standard deviation `width` (counts per pixel²)."""
    return np.asarray(counts * np.square(sigma) / (PI * np.square(np.square(width) + np.square(sigma))))


def counts_at_scale(correlation: FloatArray, sigma: FloatArray) -> FloatArray:
    """N = 4πσ²C, right if the source is as wide as the hat; else 4σ⁴/(a² + σ²)² of the counts."""
    return np.asarray(4.0 * PI * np.square(sigma) * correlation)


def width_from_scales(c1: FloatArray, sigma1: FloatArray, c2: FloatArray, sigma2: FloatArray) -> FloatArray:
    """Standard deviation of the source with C = c1 at sigma1 and c2 at sigma2; NaN where no Gaussian gives them."""
    ok = (c1 > 0.0) & (c2 > 0.0)
    root = np.sqrt(np.divide(c1, c2, out=np.ones(np.shape(c1)), where=ok))
    ratio = sigma1 / sigma2
    above = ratio * np.square(sigma2) - root * np.square(sigma1)
    square = np.divide(above, root - ratio, out=np.full(np.shape(c1), -1.0), where=ok & (root != ratio))
    return np.where(square > 0.0, np.sqrt(np.maximum(square, 0.0)), np.nan)


def correlation_variance(
    counts: FloatArray, width: FloatArray, background: FloatArray, sigma: FloatArray
) -> FloatArray:
    """Photon-noise variance of C at the centre: source, then background."""
    s2 = np.square(sigma)
    u = 1.0 / (1.0 + 0.5 * s2 / np.square(width))
    source = counts / (2.0 * PI * np.square(width)) * u * (2.0 - 2.0 * u + u**2)
    return np.asarray((source + background) / (2.0 * PI * s2))


def correlation_covariance(
    counts: FloatArray, width: FloatArray, background: FloatArray, sigma1: FloatArray, sigma2: FloatArray
) -> FloatArray:
    """Covariance of C at two scales at the centre of the source."""
    a2, p2, q2 = np.square(width), np.square(sigma1), np.square(sigma2)
    area = a2 * p2 + a2 * q2 + p2 * q2
    s2 = 2.0 * a2 * p2 * q2 / area
    source = counts / (2.0 * PI**2 * area) * (2.0 - s2 / p2 - s2 / q2 + s2**2 / (p2 * q2))
    return np.asarray(source + 4.0 * p2 * q2 * background / (PI * (p2 + q2) ** 3))


def width_error(
    counts: FloatArray, width: FloatArray, background: FloatArray, sigma1: FloatArray, sigma2: FloatArray
) -> FloatArray:
    """Error of `width_from_scales` by linear propagation from both C, their covariance and their common pixel."""
    c1, c2 = peak_correlation(counts, width, sigma1), peak_correlation(counts, width, sigma2)
    relative = (
        correlation_variance(counts, width, background, sigma1) / np.square(c1)
        + correlation_variance(counts, width, background, sigma2) / np.square(c2)
        - 2.0 * correlation_covariance(counts, width, background, sigma1, sigma2) / (c1 * c2)
        + np.square(pixel_scatter(width, sigma1) - pixel_scatter(width, sigma2))
    )
    root, ratio = np.sqrt(c1 / c2), sigma1 / sigma2
    # d(width²)/d(root) times the error of root = √(C₁/C₂)
    slope = ratio * (np.square(sigma2) - np.square(sigma1)) / np.square(root - ratio)
    return np.asarray(np.abs(slope) * 0.5 * root * np.sqrt(np.maximum(relative, 0.0)) / (2.0 * width))


def pixel_scatter(width: FloatArray, sigma: FloatArray) -> FloatArray:
    """Relative scatter of C at the pixel nearest to the source, from its place in it: C ∝ 1 − r²/(a² + σ²)."""
    return np.asarray(PHASE_SPREAD_PIX2 / (np.square(width) + np.square(sigma)))


def peak_offset(parabola: FloatArray, width: FloatArray, sigma: FloatArray) -> FloatArray:
    """Place of the peak (pix, within ±½) from that of the parabola through three pixels.

    The parabola falls short by δ·r·(1 − 4δ²), r the ratio of the fourth to the second order of the peak.
    """
    ratio = FOURTH_ORDER / (np.square(width) + np.square(sigma))
    return np.clip(parabola / (1.0 - ratio * (1.0 - 4.0 * np.square(parabola))), -0.5, 0.5)


def position_error(counts: FloatArray, width: FloatArray, background: FloatArray, sigma: FloatArray) -> FloatArray:
    """Error along one axis of the place where C is largest: noise of its slope over its curvature there."""
    s2, both = np.square(sigma), np.square(width) + np.square(sigma)
    u = 1.0 / (1.0 + 0.5 * s2 / np.square(width))
    source = 0.5 * counts / np.square(width) * np.square(u) * (8.0 - 8.0 * u + 3.0 * np.square(u))
    curvature = 4.0 * counts * np.square(s2) / both**3
    return np.asarray(np.sqrt(source + 3.0 * PI * background) / curvature)
