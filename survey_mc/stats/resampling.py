"""Intervals from resampled fields: sources of one field share its background and its blends.

Idea     draw as many fields as there are, with replacement; a fraction is the sum of what was found over the sum of
         what was tried. Its spread over many such draws knows how much fields differ, which the binomial one does not.
Source   Efron & Tibshirani 1993, "An Introduction to the Bootstrap", Ch. 6 (percentile interval); design effect: Kish
         1965, "Survey Sampling".
Limits   fewer than ten fields say little about how much fields differ; one field says nothing (NaN). An interval of
         resampled fields has no width where every field has the same fraction, 0 and 1 above all: read it beside the
         binomial one, not instead of it.

Memory: sums are kept by group of fields (realisation modulo the number of groups), at most `MAX_FIELD_GROUPS`, so it
does not grow with the number of realisations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.intervals import ONE_SIGMA, Interval
from survey_mc.types import FloatArray

MAX_FIELD_GROUPS = 1000
N_RESAMPLES = 400
TAIL = (1.0 - ONE_SIGMA) / 2.0

Numbers = NDArray[np.integer]


def n_field_groups(n_fields: int, at_most: int = MAX_FIELD_GROUPS) -> int:
    """How many groups the sums of so many fields are kept in: one a field up to a limit, at least one."""
    return max(1, min(n_fields, at_most))


def field_weights(n_groups: int, rng: np.random.Generator, n_resamples: int = N_RESAMPLES) -> FloatArray:
    """(n_resamples, n_groups) times each group is drawn; no rows for fewer than two groups."""
    n_rows = n_resamples if n_groups > 1 else 0
    drawn = rng.integers(0, n_groups, (n_rows, n_groups)) + n_groups * np.arange(n_rows)[:, None]
    return np.bincount(drawn.ravel(), minlength=n_rows * n_groups).reshape(n_rows, n_groups).astype(np.float64)


def resampled_sums(weights: FloatArray, by_group: Numbers) -> NDArray[np.int64]:
    """(n_resamples, …) sums over resampled fields. by_group: (n_groups, …) numbers of each group."""
    flat = by_group.reshape(len(by_group), -1)
    used = np.flatnonzero(flat.any(axis=0))
    sums = np.zeros((len(weights), flat.shape[1]), dtype=np.int64)
    # products of floats are exact here and, unlike those of integers, fast
    sums[:, used] = np.rint(weights @ flat[:, used].astype(np.float64)).astype(np.int64)
    return sums.reshape(len(weights), *by_group.shape[1:])


def fraction_interval_fields(
    weights: FloatArray, n_found: Numbers, n_tried: Numbers, confidence: float = ONE_SIGMA
) -> Interval:
    """(lower, upper) of Σ n_found / Σ n_tried from resampled fields, one for each column; NaN for a single field.

    weights: of `field_weights`. n_found, n_tried: (n_groups,) or (n_groups, k) numbers of each group of fields.
    """
    columns = n_found.reshape(len(n_found), -1).shape[1]
    found = resampled_sums(weights, n_found).reshape(len(weights), columns)
    tried = resampled_sums(weights, n_tried).reshape(len(weights), columns)
    again = np.divide(found, tried, out=np.full(found.shape, np.nan), where=tried > 0)
    lower, upper = inner_quantiles(again, confidence)
    shape = n_found.shape[1:]
    return lower.reshape(shape), upper.reshape(shape)


def inner_quantiles(again: FloatArray, confidence: float = ONE_SIGMA) -> FloatArray:
    """(2, k) ends of the inner `confidence` of each column of (n, k) values, NaN left out; NaN where all are."""
    result = np.full((2, again.shape[1]), np.nan)
    n = np.isfinite(again).sum(axis=0)
    some = np.flatnonzero(n)
    if not len(some):
        return result
    ascending = np.sort(again[:, some], axis=0)  # NaN last
    for row, fraction in enumerate(((1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0)):
        place = fraction * (n[some] - 1)
        below = np.floor(place).astype(np.int64)
        low = np.take_along_axis(ascending, below[None], axis=0)[0]
        high = np.take_along_axis(ascending, np.minimum(below + 1, n[some] - 1)[None], axis=0)[0]
        result[row, some] = low + (place - below) * (high - low)
    return result


def design_effect(n_found: Numbers, n_tried: Numbers) -> FloatArray:
    """Variance of the fraction between fields over the binomial one, for each column; NaN where either is unknown.

    n_found, n_tried: (n_groups,) or (n_groups, k). About 1 for independent trials; the binomial interval is too short
    by its root.
    """
    n_groups = len(n_tried)
    tried, found = n_tried.sum(axis=0, dtype=np.int64), n_found.sum(axis=0, dtype=np.int64)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = found / tried
        between = ((n_found - fraction * n_tried) ** 2).sum(axis=0) * n_groups / max(n_groups - 1, 1)
        effect = between / (tried * fraction * (1.0 - fraction))
    return np.where((n_groups > 1) & np.isfinite(effect), effect, np.nan)
