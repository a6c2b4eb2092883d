"""Sums of one extent statistic over any number of fields: confusion matrices and histograms by class.

Idea     what `classification` needs, kept as small numbers: by group of fields, class and bin of the statistic. The
         bins are the same for every statistic and every run: fine near 0 (likelihoods, stellarity of clusters), near 1
         (ratios, stellarity of points) and in steps of 4 % above.
Limits   the confusion matrices use the statistic itself; the curve, the AUC and the medians know it to one bin.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.classification import (
    EXTENDED,
    POINT,
    TRUE_CLASSES,
    area_under_curve,
    called_extended,
    confusion_by_field,
    curve_of_bins,
)
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.resampling import inner_quantiles, n_field_groups, resampled_sums
from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

MAX_GROUPS = 200  # of fields: enough to resample, and a histogram each
OTHER = 2  # third histogram: blends and spurious detections
_NEAR_ZERO = np.logspace(-8.0, np.log10(0.5), 155)
EDGES: FloatArray = np.unique(np.concatenate(([0.0], _NEAR_ZERO, 1.0 - _NEAR_ZERO, np.logspace(0.0, 6.0, 361))))
N_BINS = len(EDGES) + 2  # below the first edge, the bins, above the last; not measured


@dataclass(slots=True)
class ExtentSums:
    """Detections of one selection by one statistic and its cut. cut, larger_is_extended: as `called_extended`."""

    cut: float
    larger_is_extended: bool
    n_fields: int
    confusion: NDArray[np.int64] = field(init=False)
    histograms: NDArray[np.int32] = field(init=False)

    def __post_init__(self) -> None:
        n_groups = n_field_groups(self.n_fields, MAX_GROUPS)
        self.confusion = np.zeros((n_groups, len(TRUE_CLASSES), 2), dtype=np.int64)
        self.histograms = np.zeros((n_groups, OTHER + 1, N_BINS), dtype=np.int32)

    def add(self, values: FloatArray, true_class: NDArray[np.int64], realisation: NDArray[np.int64]) -> None:
        """Add detections: (n,) the statistic, the place in `TRUE_CLASSES` and the field of each."""
        n_groups = len(self.confusion)
        group = realisation % n_groups
        is_called = called_extended(values, self.cut, self.larger_is_extended)
        self.confusion += confusion_by_field(true_class, is_called, group, n_groups)
        known = (true_class >= 0) & (true_class < len(TRUE_CLASSES))
        kind = np.minimum(true_class[known], OTHER)
        place = (group[known] * (OTHER + 1) + kind) * N_BINS + self._bin(values[known])
        np.add.at(self.histograms.reshape(-1), place, np.int32(1))

    def _bin(self, values: FloatArray) -> NDArray[np.int64]:
        """Bins from the least to the most extended; the first one holds what was not measured."""
        place = np.searchsorted(EDGES, values, side="right") + 1
        if not self.larger_is_extended:
            place = N_BINS - place
        return np.where(np.isnan(values), 0, place).astype(np.int64)

    @property
    def is_empty(self) -> bool:
        return not self.confusion.any()

    @property
    def n_unmeasured(self) -> int:
        """Detections whose statistic is NaN."""
        return int(self.histograms[:, :, 0].sum())

    def auc(self, weights: FloatArray) -> tuple[float, float, float]:
        """AUC of points against extended detections with its interval from resampled fields; NaN without both."""
        used = self.histograms[:, :OTHER].any(axis=(0, 1))
        kinds = self.histograms[:, :OTHER, used]
        total = kinds.sum(axis=0, dtype=np.int64)
        again = resampled_sums(weights, kinds)
        ends = inner_quantiles(area_under_curve(again[:, EXTENDED], again[:, POINT])[:, None])
        return float(area_under_curve(total[EXTENDED], total[POINT])), float(ends[0, 0]), float(ends[1, 0])

    def curve(self, weights: FloatArray) -> DataFrame:
        """Contamination against completeness, with both kinds of interval; no rows without extended detections.

        weights: of `resampling.field_weights` for the groups of these sums.
        """
        used = self.histograms.any(axis=(0, 1))
        kept = self.histograms[:, :, used]
        pairs = np.stack((kept[:, EXTENDED], kept[:, POINT] + kept[:, OTHER]), axis=1)
        n, again = pairs.sum(axis=0, dtype=np.int64), resampled_sums(weights, pairs)
        curve = curve_of_bins(n[0], n[1], self._cuts()[used], again=(again[:, 0], again[:, 1]))
        return curve if n[0].any() else curve.iloc[:0]

    def _cuts(self) -> FloatArray:
        """(N_BINS,) the cut that takes in each bin and all more extended ones; NaN for the one of no measurement."""
        if self.larger_is_extended:
            return np.concatenate(([np.nan, -np.inf], EDGES))
        return np.concatenate(([np.nan, np.inf], EDGES[::-1]))

    def median(self, true_class: int) -> float:
        """Median of the statistic of a class (point or extended) among the measured ones, to one bin; NaN if none."""
        n = self.histograms[:, true_class, 1:].sum(axis=0, dtype=np.int64)
        if not n.any():
            return float("nan")
        below = np.concatenate(([0], np.cumsum(n)))
        wanted = below[-1] / 2.0
        place = int(np.searchsorted(below, wanted, side="left")) - 1
        inside = (wanted - below[place]) / n[place]
        ends = np.concatenate((EDGES[:1], EDGES, EDGES[-1:]))  # of the bins, the open ones without width
        if not self.larger_is_extended:
            ends = ends[::-1]
        return float(ends[place] + inside * (ends[place + 1] - ends[place]))


def class_of(rows: MatchRows) -> NDArray[np.int64]:
    """(n,) place in `TRUE_CLASSES` of each row of a rule's matches; −1: no detection in scope, or another kind.

    A detection that is matched, a duplicate or faint has the kind of its source; the fragments of a split cluster are
    extended, all of them.
    """
    has_source = rows.has("status", "matched", "duplicate", "faint")
    places = np.full(len(rows), -1, dtype=np.int64)
    for place, name in enumerate(TRUE_CLASSES):
        places[(has_source & rows.has("kind_true", name)) | rows.has("status", name)] = place
    return places


def listed_by_field(rows: MatchRows, is_called: BoolArray, group: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """(n, 2) of each group of fields: extended sources of the input list in the region that are matched to a
    detection called extended, and all of them, found or not. group: 0 … n − 1 of each row of a rule's matches.
    """
    is_extended = rows.has("kind_true", TRUE_CLASSES[EXTENDED])
    matched = is_extended & rows.has("status", "matched")
    listed = matched | (is_extended & rows.has("status", "missed"))
    return np.stack([np.bincount(group[keep], minlength=n) for keep in (matched & is_called, listed)], axis=1)
