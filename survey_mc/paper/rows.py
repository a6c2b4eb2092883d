"""The study's tables as arrays, each made once, and the two ways of repeating an experiment.

Idea     a number the paper has from one image is compared with ours of single images; one it has from ten images with
         ours of ten fields, drawn again and again from those we have. Sums are kept by field, so that a drawn group is
         a weighted sum and no table is read twice.
Source   bootstrap: Efron & Tibshirani 1993, Ch. 6.
Limits   each group of ten is drawn from a resampled set of our fields: the spread then holds both the chance of ten
         fields and that of our own limited number.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.match.outcome import STATUSES
from survey_mc.paper.lacking import lack
from survey_mc.paper.results import StudyResults
from survey_mc.paper.views import View
from survey_mc.rng import stream
from survey_mc.types import BoolArray, FloatArray
from survey_mc.units import SECONDS_PER_KS

if TYPE_CHECKING:
    from pandas import DataFrame, Series

FIELDS_OF_THE_PAPER = 10
N_GROUPS = 500
NUMBERS_PER_FIELD = 2**32
LEAST_FIELDS = 5  # below, drawing ten from them says nothing

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MatchRows:
    """Matches of one campaign, cell, method and rule; sources and detections that are not there have NaN."""

    n_fields: int
    field: Indices
    status: NDArray[np.int8]
    is_extended: BoolArray
    source_id: Indices
    det_id: Indices
    sep_arcsec: FloatArray
    counts: FloatArray
    counts_corrected: FloatArray
    counts_onaxis: FloatArray
    counts_expected: FloatArray
    flux_cgs: FloatArray
    flux_true_cgs: FloatArray
    offaxis_arcmin: FloatArray

    def is_status(self, *statuses: str) -> BoolArray:
        """(n,) whether a row has one of these statuses."""
        return np.isin(self.status, [STATUSES.index(status) for status in statuses])

    def per_field(self, chosen: BoolArray) -> FloatArray:
        """(n_fields,) number of chosen rows of each field."""
        return np.bincount(self.field[chosen], minlength=self.n_fields).astype(np.float64)

    def summed(self, chosen: BoolArray, values: FloatArray) -> FloatArray:
        """(n_fields,) sum of the chosen rows' values of each field."""
        return np.bincount(self.field[chosen], values[chosen], self.n_fields).astype(np.float64)

    def ratio(self, view: View) -> FloatArray:
        """(n,) measured over input counts as the view has them; NaN where there is none."""
        below: FloatArray = getattr(self, view.input_counts)
        above: FloatArray = getattr(self, view.measured_counts)
        return divided(above, below)


@dataclass(frozen=True, slots=True)
class TruthRows:
    """True sources of one campaign and cell, sorted by field and number. Those outside the image are not stored."""

    n_fields: int
    field: Indices
    key: Indices
    is_extended: BoolArray
    flux_cgs: FloatArray
    offaxis_arcmin: FloatArray
    redshift: FloatArray
    group_id: Indices
    group_sep_arcsec: FloatArray
    counts_onaxis: FloatArray
    counts_expected: FloatArray
    x_pix: FloatArray
    y_pix: FloatArray

    def at(self, field: Indices, source_id: Indices) -> Indices:
        """Rows of sources, by field and number; any row for no source (-1)."""
        return np.minimum(np.searchsorted(self.key, _key(field, source_id)), len(self.key) - 1)


@dataclass(frozen=True, slots=True)
class LinkRows:
    """Pairs of detections and sources near each other. source: rows of `TruthRows`."""

    field: Indices
    det_id: Indices
    source: Indices
    sep_arcsec: FloatArray


class StudyRows:
    """A study opened for statistics. Arrays are shared and must not be changed."""

    def __init__(self, results: StudyResults) -> None:
        self.results = results
        self.rows_of = cache(self._match_rows)
        self.truth = cache(self._truth_rows)
        self.detections = cache(self._detections)
        self.links_to_clusters = cache(self._links_to_clusters)
        self._detection_keys = cache(self._keys_of_detections)
        self.groups = cache(group_weights)

    def matches(self, view: View, method: str = "", cell: str = "") -> MatchRows:
        """Matches of a view: of its first method and cell unless others are named."""
        name = method or view.method
        return self.rows_of(view.campaign_of(name), name, cell or view.cell, view.rule)

    def truth_of(self, view: View, cell: str = "") -> TruthRows:
        """True sources of a view."""
        return self.truth(view.campaign, cell or view.cell)

    def n_fields(self, view: View) -> int:
        """Fields of a view."""
        return self.results.n_fields(view.campaign)

    def exposure_s(self, view: View) -> float:
        """Exposure of the view's cell."""
        return self.results.run(view.campaign).data.cell(view.cell).exposure_ks * SECONDS_PER_KS

    def of_detections(self, view: View, column: str, field: Indices, det_id: Indices) -> FloatArray:
        """(n,) a column of detections, by field and number; NaN for no detection (-1)."""
        frame = self.detections(view.campaign, view.method, view.cell)
        known = det_id >= 0
        stored = self._detection_keys(view.campaign, view.method, view.cell)
        values = np.full(len(field), np.nan)
        row = np.searchsorted(stored, _key(field[known], det_id[known]))
        values[known] = frame[column].to_numpy(np.float64)[row]
        return values

    def links(self, view: View) -> LinkRows:
        """Candidate pairs of a view."""
        frame, truth = self.results.links(view.campaign, view.method, view.cell), self.truth_of(view)
        field = frame["realisation"].to_numpy(np.int64)
        source = truth.at(field, frame["source_id"].to_numpy(np.int64))
        return LinkRows(field, frame["det_id"].to_numpy(np.int64), source, _floats(frame, "sep_arcsec"))

    def lack(self, view: View) -> str:
        """What a view needs and the study does not have, in words; empty if it has all."""
        return lack(self.results, view)

    def _match_rows(self, campaign: str, method: str, cell: str, rule: str) -> MatchRows:
        frame = self.results.matches(campaign, method, rule, cell)
        record = self.results.run(campaign).data.cell(cell)
        exposure_s = record.exposure_ks * SECONDS_PER_KS
        return MatchRows(
            n_fields=record.realisations,
            field=frame["realisation"].to_numpy(np.int64),
            status=_codes(frame["status"]),
            is_extended=(frame["kind_true"] == "extended").to_numpy(bool),
            source_id=frame["source_id"].to_numpy(np.int64),
            det_id=frame["det_id"].to_numpy(np.int64),
            counts_corrected=_floats(frame, "flux_cgs") / record.flux_per_rate_cgs * exposure_s,
            **{name: _floats(frame, name) for name in _MATCH_NUMBERS},
        )

    def _truth_rows(self, campaign: str, cell: str) -> TruthRows:
        frame = self.results.truth(campaign, cell)
        n_fields = self.results.n_fields(campaign)
        field = frame["realisation"].to_numpy(np.int64)
        return TruthRows(
            n_fields=n_fields,
            field=field,
            key=_key(field, frame["source_id"].to_numpy(np.int64)),
            is_extended=(frame["kind"] == "extended").to_numpy(bool),
            group_id=frame["group_id"].to_numpy(np.int64),
            **{name: _floats(frame, name) for name in _TRUTH_NUMBERS},
        )

    def _detections(self, campaign: str, method: str, cell: str) -> DataFrame:
        return self.results.detections(campaign, method, cell)

    def _keys_of_detections(self, campaign: str, method: str, cell: str) -> Indices:
        frame = self.detections(campaign, method, cell)
        return _key(frame["realisation"].to_numpy(np.int64), frame["det_id"].to_numpy(np.int64))

    def _links_to_clusters(self, view: View) -> LinkRows:
        """Candidate pairs with extended sources, nearest first in each field."""
        links, truth = self.links(view), self.truth_of(view)
        used = np.flatnonzero(truth.is_extended[links.source])
        used = used[np.lexsort((links.det_id[used], links.sep_arcsec[used], links.field[used]))]
        return LinkRows(links.field[used], links.det_id[used], links.source[used], links.sep_arcsec[used])


_MATCH_NUMBERS = (
    "sep_arcsec", "counts", "counts_onaxis", "counts_expected", "flux_cgs", "flux_true_cgs", "offaxis_arcmin",
)  # fmt: skip
_TRUTH_NUMBERS = (
    "flux_cgs", "offaxis_arcmin", "redshift", "group_sep_arcsec", "counts_onaxis", "counts_expected", "x_pix", "y_pix",
)  # fmt: skip


def _key(field: Indices, number: Indices) -> Indices:
    """One number for a field and the number of a source or detection in it."""
    return field * NUMBERS_PER_FIELD + number


def _codes(statuses: Series) -> NDArray[np.int8]:
    """Places in `STATUSES`."""
    from pandas import Categorical

    return np.asarray(Categorical(statuses, categories=list(STATUSES)).codes, dtype=np.int8)


def _floats(frame: DataFrame, name: str) -> FloatArray:
    return np.asarray(frame[name].to_numpy(np.float64))


def group_weights(n_fields: int, size: int = FIELDS_OF_THE_PAPER, n_groups: int = N_GROUPS) -> FloatArray:
    """(n_groups, n_fields) how often each field is in each drawn group; no rows for too few fields.

    The same for all statistics of as many fields, so that options are compared on the same groups.
    """
    if n_fields < LEAST_FIELDS:
        return np.empty((0, n_fields))
    rng = stream(f"valtchanov2001/{n_fields}/{size}", "groups of fields")
    ours = rng.integers(0, n_fields, (n_groups, n_fields))
    drawn = np.take_along_axis(ours, rng.integers(0, n_fields, (n_groups, size)), axis=1)
    place = drawn + n_fields * np.arange(n_groups)[:, None]
    return np.bincount(place.ravel(), minlength=n_groups * n_fields).reshape(n_groups, n_fields).astype(np.float64)


@dataclass(frozen=True, slots=True)
class Moments:
    """Sums over values by field or by group: number, Σx, Σx² (all (k,))."""

    n: FloatArray
    total: FloatArray
    squares: FloatArray

    @classmethod
    def of(cls, rows: MatchRows, chosen: BoolArray, values: FloatArray) -> Moments:
        """Sums by field of the chosen rows whose value is known."""
        used = chosen & np.isfinite(values)
        field, x = rows.field[used], values[used]

        def summed(weights: FloatArray) -> FloatArray:
            return np.bincount(field, weights, rows.n_fields).astype(np.float64)

        return cls(n=summed(np.ones(len(x))), total=summed(x), squares=summed(x * x))

    def drawn(self, weights: FloatArray) -> Moments:
        """The same sums of drawn groups of fields."""
        return Moments(weights @ self.n, weights @ self.total, weights @ self.squares)

    @property
    def mean(self) -> FloatArray:
        return divided(self.total, self.n)

    @property
    def rms(self) -> FloatArray:
        return np.sqrt(divided(self.squares, self.n))

    @property
    def stdev(self) -> FloatArray:
        """Standard deviation about the mean; NaN for fewer than two values."""
        above = np.maximum(self.squares - divided(self.total**2, self.n), 0.0)
        return np.sqrt(divided(above, np.where(self.n > 1, self.n - 1.0, 0.0)))

    @property
    def about_unity(self) -> FloatArray:
        """Root mean square of x − 1."""
        return np.sqrt(divided(np.maximum(self.squares - 2.0 * self.total + self.n, 0.0), self.n))


def divided(above: FloatArray, below: FloatArray) -> FloatArray:
    """above / below, NaN where there is nothing to divide by."""
    result: FloatArray = np.divide(above, below, out=np.full(np.shape(above), np.nan), where=np.asarray(below) > 0)
    return result
