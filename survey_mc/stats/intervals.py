"""Intervals of counted things: binomial fractions and Poisson numbers.

Idea     quantiles of the Beta and Gamma distributions; every function takes arrays and returns (lower, upper).
Source   Brown, Cai & DasGupta 2001, Stat. Sci. 16, 101 (Jeffreys, Wilson); Clopper & Pearson 1934, Biometrika 26, 404;
         Garwood 1936, Biometrika 28, 437; Gehrels 1986, ApJ 303, 336 for their use in astronomy.
Limits   trials are taken as independent. The Wald interval is left out on purpose: its coverage can be zero.
"""

from __future__ import annotations

from math import erf, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincinv, gammaincinv, ndtri

from survey_mc.types import FloatArray

ONE_SIGMA = erf(1.0 / sqrt(2.0))  # 0.6827, the confidence of ±1σ of a Gaussian
CLAIM = 0.95  # confidence of the intervals given for claims
Interval = tuple[FloatArray, FloatArray]


def jeffreys(n_found: ArrayLike, n_tried: ArrayLike, confidence: float = ONE_SIGMA) -> Interval:
    """Interval for display: Beta(k + ½, n − k + ½) quantiles, closed at 0 for k = 0 and at 1 for k = n.

    n_tried = 0 gives (0, 1): nothing is known.
    """
    k, n = _numbers(n_found, n_tried)
    tail = (1.0 - confidence) / 2.0
    lower = np.where(k > 0, betaincinv(k + 0.5, n - k + 0.5, tail), 0.0)
    upper = np.where(k < n, betaincinv(k + 0.5, n - k + 0.5, 1.0 - tail), 1.0)
    return lower, upper


def clopper_pearson(n_found: ArrayLike, n_tried: ArrayLike, confidence: float = ONE_SIGMA) -> Interval:
    """Interval for claims ("at least …"): its coverage is never below the confidence."""
    k, n = _numbers(n_found, n_tried)
    tail = (1.0 - confidence) / 2.0
    lower = np.where(k > 0, betaincinv(np.maximum(k, 0.5), n - k + 1.0, tail), 0.0)
    upper = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 0.5), 1.0 - tail), 1.0)
    return lower, upper


def wilson(n_found: ArrayLike, n_tried: ArrayLike, confidence: float = ONE_SIGMA) -> Interval:
    """Score interval: the fractions whose binomial σ reaches the observed one. n_tried = 0 gives (0, 1)."""
    k, n = _numbers(n_found, n_tried)
    z2 = ndtri(0.5 + confidence / 2.0) ** 2
    trials = np.maximum(n, 1.0)
    fraction = k / trials
    centre = (fraction + z2 / (2.0 * trials)) / (1.0 + z2 / trials)
    half = np.sqrt(z2 * (fraction * (1.0 - fraction) + z2 / (4.0 * trials)) / trials) / (1.0 + z2 / trials)
    lower = np.where((n > 0) & (k > 0), np.maximum(centre - half, 0.0), 0.0)
    upper = np.where((n > 0) & (k < n), np.minimum(centre + half, 1.0), 1.0)
    return lower, upper


def garwood(n_counted: ArrayLike, confidence: float = ONE_SIGMA) -> Interval:
    """Exact central interval of a Poisson mean; n = 0 gives 0 … 1.841 at one sigma."""
    n = np.asarray(n_counted, dtype=np.float64)
    tail = (1.0 - confidence) / 2.0
    lower = np.where(n > 0, gammaincinv(np.maximum(n, 0.5), tail), 0.0)
    return lower, np.asarray(gammaincinv(n + 1.0, 1.0 - tail), dtype=np.float64)


def _numbers(n_found: ArrayLike, n_tried: ArrayLike) -> tuple[FloatArray, FloatArray]:
    k, n = np.broadcast_arrays(np.asarray(n_found, dtype=np.float64), np.asarray(n_tried, dtype=np.float64))
    if np.any(k < 0) or np.any(k > n):
        raise ValueError("n_found must lie between 0 and n_tried")
    return k, n
