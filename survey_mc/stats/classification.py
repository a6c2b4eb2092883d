"""Telling extended sources from points: how often a statistic and its cut are right.

Idea     every detection has a true class and is called point or extended; the confusion matrix holds all there is to
         say of one cut. Moving the cut gives the curve of contamination against completeness, and the area under the
         receiver's curve (AUC): the probability that an extended source looks more extended than a point.
Source   Valtchanov et al. 2001, Sect. 3.5, 5.4 and 7.3 (stellarity below 0.1, r50 of at least 20″, more than 20
         detected counts, inside 10′); AUC: Mann & Whitney 1947; Hanley & McNeil 1982.
Limits   contamination depends on how many points there are for each extended source: it holds for the simulated sky
         only, the AUC for any mixture. What was never detected is not in the matrix.

A detection whose statistic is NaN is called point, and ranks as the least extended of all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.intervals import ONE_SIGMA, garwood, jeffreys
from survey_mc.stats.resampling import (
    N_RESAMPLES,
    design_effect,
    field_weights,
    fraction_interval_fields,
    inner_quantiles,
)
from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

TRUE_CLASSES = ("point", "extended", "blend", "spurious")
POINT, EXTENDED, BLEND, SPURIOUS = range(len(TRUE_CLASSES))
CALLED = ("point", "extended")
N_CURVE_POINTS = 60
HALF_TIE = 0.5


@dataclass(frozen=True, slots=True)
class JointCut:
    """The paper's rule of Sect. 7.3: all four must hold."""

    stellarity_max: float = 0.1
    r50_min_arcsec: float = 20.0
    counts_min: float = 20.0
    offaxis_max_arcmin: float = 10.0

    def applies(self, counts: FloatArray, offaxis_arcmin: FloatArray) -> BoolArray:
        """Whether each detection is bright and central enough to be judged."""
        return np.asarray((counts > self.counts_min) & (offaxis_arcmin < self.offaxis_max_arcmin))

    def called_extended(
        self, stellarity: FloatArray, r50_arcsec: FloatArray, counts: FloatArray, offaxis_arcmin: FloatArray
    ) -> BoolArray:
        """(n,) whether each detection is called extended; NaN is never."""
        looks_extended = (stellarity < self.stellarity_max) & (r50_arcsec >= self.r50_min_arcsec)
        return np.asarray(looks_extended & self.applies(counts, offaxis_arcmin))


PAPER_CUT = JointCut()


def called_extended(values: FloatArray, cut: float, larger_is_extended: bool = True) -> BoolArray:
    """(n,) whether each value is at or above the cut, or below it where smaller is extended; NaN is never."""
    return np.asarray(values >= cut if larger_is_extended else values < cut)


def confusion_by_field(
    true_class: NDArray[np.integer], is_called: BoolArray, field: NDArray[np.integer], n_fields: int
) -> NDArray[np.int64]:
    """(n_fields, 4, 2) detections of each field by `TRUE_CLASSES` and by point or extended as called.

    true_class: (n,) places in `TRUE_CLASSES`, others are left out. field: (n,) 0 … n_fields − 1. Its sum over the
    fields is the confusion matrix.
    """
    known = (true_class >= 0) & (true_class < len(TRUE_CLASSES))
    place = (field[known] * len(TRUE_CLASSES) + true_class[known]) * 2 + is_called[known]
    size = n_fields * len(TRUE_CLASSES) * 2
    return np.bincount(place, minlength=size).astype(np.int64).reshape(n_fields, len(TRUE_CLASSES), 2)


@dataclass(frozen=True, slots=True)
class Rate:
    """A fraction of one confusion matrix with its intervals; NaN value where nothing was tried.

    lower, upper: Jeffreys. lower_fields, upper_fields: resampled fields, NaN for a single one.
    """

    n_found: int
    n_tried: int
    lower: float
    upper: float
    lower_fields: float
    upper_fields: float
    design_effect: float

    @property
    def value(self) -> float:
        return self.n_found / self.n_tried if self.n_tried else float("nan")


def classification_rates(confusion: NDArray[np.integer], weights: FloatArray) -> dict[str, Rate]:
    """The rates of a classification, each with its intervals.

    confusion: (n_fields, 4, 2) of `confusion_by_field`. weights: of `resampling.field_weights` for n_fields; no rows
    for no intervals of resampled fields. Rates: "completeness", extended detections called extended; "contamination",
    of all called extended those that are not; "false_extended", points called extended; "wrong", of all detections
    the extended ones called point and the others called extended.
    """
    called = confusion[:, :, 1]
    others_called = called.sum(axis=1) - called[:, EXTENDED]
    pairs = {
        "completeness": (called[:, EXTENDED], confusion[:, EXTENDED].sum(axis=1)),
        "contamination": (others_called, called.sum(axis=1)),
        "false_extended": (called[:, POINT], confusion[:, POINT].sum(axis=1)),
        "wrong": (others_called + confusion[:, EXTENDED, 0], confusion.sum(axis=(1, 2))),
    }
    return {name: rate_of(found, tried, weights) for name, (found, tried) in pairs.items()}


def rate_of(n_found: NDArray[np.integer], n_tried: NDArray[np.integer], weights: FloatArray) -> Rate:
    """The fraction Σ n_found / Σ n_tried with its intervals. n_found, n_tried: (n_fields,) numbers of each field."""
    found, tried = int(n_found.sum()), int(n_tried.sum())
    lower, upper = jeffreys(found, tried)
    lower_fields, upper_fields = fraction_interval_fields(weights, n_found, n_tried)
    return Rate(
        n_found=found,
        n_tried=tried,
        lower=float(lower),
        upper=float(upper),
        lower_fields=float(lower_fields),
        upper_fields=float(upper_fields),
        design_effect=float(design_effect(n_found, n_tried)),
    )


def area_under_curve(extended: NDArray[np.integer], point: NDArray[np.integer]) -> FloatArray:
    """Probability that an extended detection looks more extended than a point, ties half; NaN without both.

    extended, point: (…, bins) numbers in bins of the statistic, from the least to the most extended.
    """
    points_below = np.cumsum(point, axis=-1) - (1.0 - HALF_TIE) * point
    pairs = np.asarray(extended.sum(axis=-1) * point.sum(axis=-1), dtype=np.float64)
    won = np.asarray((extended * points_below).sum(axis=-1), dtype=np.float64)
    return np.asarray(np.divide(won, pairs, out=np.full(pairs.shape, np.nan), where=pairs > 0))


def auc(values: FloatArray, is_extended: BoolArray, larger_is_extended: bool = True) -> float:
    """Area under the receiver's curve of points against extended detections: 0.5 is guessing, 1 perfect.

    values: (n,) the statistic. is_extended: (n,) the truth; leave blends and spurious detections out.
    """
    _, place = np.unique(_ranked(values, larger_is_extended), return_inverse=True)
    size = int(place.max()) + 1 if len(place) else 1
    both = [np.bincount(place[chosen], minlength=size) for chosen in (is_extended, ~is_extended)]
    return float(area_under_curve(both[0], both[1]))


def auc_interval_fields(
    values: FloatArray,
    is_extended: BoolArray,
    field: NDArray[np.integer],
    rng: np.random.Generator,
    larger_is_extended: bool = True,
    n_resamples: int = N_RESAMPLES,
) -> tuple[float, float]:
    """(lower, upper) of `auc` from resampled fields (68.27 %); NaN for a single field. field: (n,) any numbers."""
    _, place = np.unique(_ranked(values, larger_is_extended), return_inverse=True)
    fields, row = np.unique(field, return_inverse=True)
    weights = field_weights(len(fields), rng, n_resamples)
    again = np.empty((len(weights), 1))
    for i, times in enumerate(weights):
        share = times[row]
        both = [np.bincount(place, weights=share * chosen) for chosen in (is_extended, ~is_extended)]
        again[i] = area_under_curve(both[0], both[1])
    lower, upper = inner_quantiles(again, ONE_SIGMA)[:, 0]
    return float(lower), float(upper)


def contamination_curve(
    values: FloatArray, is_extended: BoolArray, larger_is_extended: bool = True, n_max: int = N_CURVE_POINTS
) -> DataFrame:
    """Completeness and contamination of the extended class at every distinct cut, at most about `n_max` of them.

    values: (n,) the statistic. is_extended: (n,) the truth, anything else being a contaminant. Rows from the strictest
    cut to the loosest: threshold, n_extended_called, n_other_called, completeness and contamination with Jeffreys
    intervals. A row's cut calls extended what is at or beyond its threshold.
    """
    ranked = _ranked(values, larger_is_extended)
    levels, place = np.unique(ranked, return_inverse=True)
    both = [np.bincount(place[chosen], minlength=len(levels)) for chosen in (is_extended, ~is_extended)]
    curve = curve_of_bins(both[0], both[1], levels, n_max)
    return curve if larger_is_extended else curve.assign(threshold=-curve["threshold"])


def curve_of_bins(
    extended: NDArray[np.integer],
    other: NDArray[np.integer],
    lower_edges: FloatArray,
    n_max: int = N_CURVE_POINTS,
    again: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None,
) -> DataFrame:
    """The curve of `contamination_curve` from numbers in bins, least extended first; lower_edges: the cuts.

    again: the same two numbers of resampled fields, (n_resamples, bins), for intervals of resampled fields.
    """
    import pandas as pd

    n_extended, n_other = (np.cumsum(n[::-1]) for n in (extended, other))
    rows = _thinned(n_extended, n_extended + n_other, n_max)
    frame = {
        "threshold": lower_edges[::-1][rows],
        "n_extended_called": n_extended[rows],
        "n_other_called": n_other[rows],
    }
    pairs = _curve_fractions(n_extended, n_other, rows)
    for name, (found, tried) in pairs.items():
        lower, upper = jeffreys(found, tried)
        frame |= {name: _quotient(found, tried), f"{name}_lower": lower, f"{name}_upper": upper}
    if again is not None:
        many = _curve_fractions(np.cumsum(again[0][:, ::-1], axis=1), np.cumsum(again[1][:, ::-1], axis=1), rows)
        for name, (found, tried) in many.items():
            lower, upper = inner_quantiles(_quotient(found, tried))
            frame |= {f"{name}_lower_fields": lower, f"{name}_upper_fields": upper}
    return pd.DataFrame(frame)


def _curve_fractions(
    n_extended: NDArray[np.integer], n_other: NDArray[np.integer], rows: NDArray[np.int64]
) -> dict[str, tuple[NDArray[np.integer], NDArray[np.integer]]]:
    """Found and tried of both axes of the curve at some rows. n_extended, n_other: (…, bins), cumulated."""
    kept, lost = n_extended[..., rows], n_other[..., rows]
    every = np.broadcast_to(n_extended[..., -1:], kept.shape)
    return {"completeness": (kept, every), "contamination": (lost, kept + lost)}


def _quotient(found: NDArray[np.integer], tried: NDArray[np.integer]) -> FloatArray:
    return np.asarray(np.divide(found, tried, out=np.full(found.shape, np.nan), where=tried > 0))


def _thinned(n_extended: NDArray[np.integer], n_called: NDArray[np.integer], n_max: int) -> NDArray[np.int64]:
    """Rows that call more than the one before; of too many, the last one of each of n_max equal steps.

    n_extended, n_called: cumulated. Half of a step is in completeness, half in the logarithm of what is called: the
    strict end, where contamination moves fastest, keeps every row.
    """
    rows = np.flatnonzero(np.diff(n_called, prepend=0))
    if len(rows) <= n_max:
        return rows
    called, kept = np.log(n_called[rows]), n_extended[rows]
    measure = called / called[-1] + kept / max(int(kept[-1]), 1)
    step = np.floor(measure / 2.0 * (n_max - 1))
    return np.asarray(rows[np.append(np.diff(step) > 0, True)])


def _ranked(values: FloatArray, larger_is_extended: bool) -> FloatArray:
    """Values that grow with the extent, NaN the least of all."""
    ranked = values if larger_is_extended else -values
    return np.where(np.isnan(ranked), -np.inf, ranked)


def per_area(n: int, area_deg2: float) -> tuple[float, float, float]:
    """Density (1/deg²) of n things with its Garwood interval (68.27 %); NaN without an area."""
    area = area_deg2 if area_deg2 > 0 else float("nan")
    lower, upper = garwood(n)
    return n / area, float(lower) / area, float(upper) / area
