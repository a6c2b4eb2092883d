"""Significance of a wavelet coefficient made of few photons.

Idea     the histogram of the mother wavelet over its support is the distribution of the coefficient of one photon that
         falls anywhere in it; n photons give its n-fold autoconvolution, taken here as a power of its Fourier
         transform. The quantiles of the reduced coefficient W = w·4^s / (√n·σ_ψ) are tabulated at n = 2^p.
Source   Slezak et al. 1993 A&A 277, 301; Starck & Pierre 1998 A&AS 128, 397 ("wavelet function histogram").
Limits   tabulated to n = 2^17, beyond it the skewness term ∝ n^(−1/2) is extrapolated; significance ≥ 1e-9.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from survey_mc.caches import bounded_cache
from survey_mc.detect._shared.exact_threshold import STD_SPAN, WEIGHT_SPAN, split_histogram, tail_crossing
from survey_mc.types import FloatArray

SUPPORT_PIX = 4.0  # the mother wavelet lives on [−4, 4]²
SAMPLES_PER_AXIS = 1024  # of one quadrant, by symmetry
FINE_BINS = 2**14
GRID_BINS = 2**17
LAST_OCTAVE = 17


def cubic_spline(x: FloatArray) -> FloatArray:
    """B(x), the cubic B-spline of unit integral on [−2, 2]."""
    outer = np.abs(x - 2) ** 3 + np.abs(x + 2) ** 3
    inner = np.abs(x - 1) ** 3 + np.abs(x + 1) ** 3
    return np.asarray((outer - 4 * inner + 6 * np.abs(x) ** 3) / 12.0)


@dataclass(frozen=True, slots=True)
class Abaque:
    """Thresholds of the reduced coefficient: lower[p], upper[p] for n = 2^p photons, p = 0 … 17."""

    significance: float
    sigma_psi: float
    lower: FloatArray
    upper: FloatArray


@bounded_cache(1)
def wavelet_histogram() -> tuple[FloatArray, FloatArray, float]:
    """Values of ψ, their probabilities for a photon placed uniformly on the support, and σ_ψ."""
    x = (np.arange(SAMPLES_PER_AXIS, dtype=np.float64) + 0.5) * (SUPPORT_PIX / SAMPLES_PER_AXIS)
    narrow, wide = cubic_spline(x), cubic_spline(x / 2.0)
    psi = (np.outer(narrow, narrow) - 0.25 * np.outer(wide, wide)).ravel()
    sigma = math.sqrt(np.square(psi).mean() - psi.mean() ** 2)
    step = float(np.ptp(psi)) / (FINE_BINS - 2)
    probability = split_histogram(psi - psi.min(), np.full(psi.size, 1.0 / psi.size), step, FINE_BINS)
    values = psi.min() - psi.mean() + step * np.arange(FINE_BINS)
    return values, probability, sigma


def _quantiles(n_photons: int, significance: float) -> tuple[float, float]:
    """Values below and above which the coefficient of n photons lies with probability `significance` each."""
    values, probability, sigma = wavelet_histogram()
    span = STD_SPAN * math.sqrt(n_photons) * sigma + WEIGHT_SPAN * values.max()
    step = 2.0 * span / GRID_BINS
    one_photon = split_histogram(values, probability, step, GRID_BINS)
    photons = np.fft.irfft(np.fft.rfft(one_photon) ** n_photons, GRID_BINS)
    ordered = np.clip(np.roll(photons, GRID_BINS // 2), 0.0, None)
    grid = (np.arange(GRID_BINS) - GRID_BINS // 2) * step
    below = np.cumsum(ordered)
    above = np.cumsum(ordered[::-1])[::-1]
    upper = tail_crossing(grid, above, significance)
    return -tail_crossing(-grid[::-1], below[::-1], significance), upper


@bounded_cache(32)
def abaque(significance: float) -> Abaque:
    """Table of thresholds for a one-sided false-alarm probability `significance` in each tail."""
    sigma = wavelet_histogram()[2]
    pairs = np.array([_quantiles(2**p, significance) for p in range(LAST_OCTAVE + 1)])
    reduced = pairs / (sigma * np.sqrt(2.0 ** np.arange(LAST_OCTAVE + 1)))[:, None]
    return Abaque(significance, sigma, reduced[:, 0].copy(), reduced[:, 1].copy())


def thresholds(n_photons: FloatArray, table: Abaque) -> tuple[FloatArray, FloatArray]:
    """t_min and t_max of the reduced coefficient for n ≥ 1 photons, linear in log₂ n between tabulated octaves."""
    n = np.asarray(n_photons, dtype=np.float64)
    octave = np.log2(n)
    octaves = np.arange(LAST_OCTAVE + 1)
    gaussian = float(ndtri(table.significance))
    fade = np.sqrt(np.minimum(1.0, 2.0**LAST_OCTAVE / n))  # skewness falls as 1/√n beyond the table
    lower = gaussian + (np.interp(octave, octaves, table.lower) - gaussian) * fade
    upper = -gaussian + (np.interp(octave, octaves, table.upper) + gaussian) * fade
    return lower, upper


@bounded_cache(8)
def coefficient_limits(significance: float, min_events: int) -> tuple[FloatArray, FloatArray]:
    """Unreduced limits t·√n·σ_ψ at scale 0 for n = 0 … 2^17 photons (divide by 4^s at scale s).

    Below `min_events` photons nothing is ever significant: the limits are infinite.
    """
    table = abaque(significance)
    n = np.arange(2**LAST_OCTAVE + 1, dtype=np.float64)
    lower, upper = thresholds(np.maximum(n, 1.0), table)
    spread = np.sqrt(n) * table.sigma_psi
    lower, upper = lower * spread, upper * spread
    lower[:min_events], upper[:min_events] = -np.inf, np.inf
    lower.setflags(write=False)
    upper.setflags(write=False)
    return lower, upper
