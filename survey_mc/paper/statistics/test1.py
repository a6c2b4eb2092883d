"""Test 1: pairs of point sources, one image.

Source   paper Sect. 4, Tab. 4.
Limits   the paper gives the photometric scatter for all procedures together: ours is the median of five procedures,
         VTPDETECT left out, which merges the pairs. Its EWAVELET counts were corrected there, ours are not.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from survey_mc.paper.rows import Indices, MatchRows, Moments, StudyRows, TruthRows, divided
from survey_mc.paper.statistics.statistic import Evidence, Reading, Statistic, Values
from survey_mc.paper.study import GRID, TEST_1
from survey_mc.paper.views import ALL_METHODS, LABELS, View
from survey_mc.stats.bins import LogBins
from survey_mc.stats.completeness import LEVELS, crossings
from survey_mc.types import BoolArray, FloatArray

HEW_ARCSEC, WIDE_ARCSEC = 15.0, 60.0  # separations of the layout: the smallest and the largest
BRIGHT_COUNTS = 100.0  # "brighter" members: those of 100 counts and more
PHOTOMETRIC = tuple(label for label in ALL_METHODS if label != LABELS["vtpdetect"])
HALF = LEVELS.index(0.5)
COUNTS_BINS = LogBins("counts_expected", 0, 5)

ABOUT_MEAN = Reading("scatter about the mean", "standard deviation about the mean ratio instead of the unity line")
WITHOUT_VTP = Reading("without VTPDETECT", "the other five; the paper leaves VTPDETECT out after this test")
FAINTER_ALONE = Reading("fainter member alone", "the fainter member is found, whatever became of the brighter")


def evidence() -> Iterator[Evidence]:
    """The claims test1.*."""
    for name, label in LABELS.items():
        view = View(TEST_1, (label,))
        yield _image(f"test1.{name}.missed", "listed sources without a detection in one image", missed, view)
        yield _image(f"test1.{name}.false", "detections without a listed source in one image", false, view)
    # Matches by position cannot be further apart than the search radius, which is as large as the printed bound.
    everyone = View(TEST_1, ALL_METHODS, rule="origin")
    yield _image(
        "test1.pos_error", "largest rms distance of any procedure's detections from the sources they rest on",
        largest_rms, everyone, WITHOUT_VTP,
    )  # fmt: skip
    yield _image(
        "test1.dr15.eml_only", "pairs at 15″ with both members found", partial(separated, separation_arcsec=15.0),
        View(TEST_1, ("EMLDETECT",)), FAINTER_ALONE,
    )  # fmt: skip
    for name, bright in (("bright", True), ("faint", False)):
        which = "100 counts and more" if bright else "below 100 counts"
        yield _image(
            f"test1.dr60.flux_{name}",
            f"rms of (measured/input counts − 1) of members with {which} at 60″, median of five procedures",
            partial(flux_scatter, bright=bright), View(TEST_1, PHOTOMETRIC), ABOUT_MEAN,
        )  # fmt: skip
    vtp = View(TEST_1, ("VTPDETECT",), rule="origin")
    yield _image("test1.vtp.offset", "largest distance of a detection from the source it rests on", largest_offset, vtp)
    yield _image(
        "test1.vtp.merge30",
        "pairs at 30″ with both members found",
        partial(separated, separation_arcsec=30.0),
        View(TEST_1, ("VTPDETECT",)),
    )
    yield _image(
        "test1.ewav.loss", "1 − mean measured/input counts of matches at 30 and 60″", loss, View(TEST_1, ("EWAVELET",))
    )
    yield Statistic(
        "test1.limit", "expected counts at which half of the isolated sources (grid of Test 5) are found",
        "groups of ten fields", half_limit, View(GRID),
    )  # fmt: skip


def _image(claim: str, about: str, values: Values, view: View, *readings: Reading) -> Statistic:
    return Statistic(claim, about, "single images", values, view, readings)


def missed(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) missed sources."""
    rows = study.matches(view)
    return rows.per_field(rows.is_status("missed"))


def false(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) detections that count as false."""
    rows = study.matches(view)
    return rows.per_field(rows.is_status(*view.false) & (rows.offaxis_arcmin <= view.region_arcmin))


def largest_rms(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) arcsec: the worst procedure of each image."""
    methods = PHOTOMETRIC if view.reading == WITHOUT_VTP.name else view.methods
    every = [_separations(study.matches(view, method)).rms for method in methods]
    return np.asarray(np.max(every, axis=0))


def _separations(rows: MatchRows) -> Moments:
    return Moments.of(rows, rows.is_status("matched"), rows.sep_arcsec)


def pair_separation(study: StudyRows, view: View, rows: MatchRows) -> FloatArray:
    """(n,) arcsec, designed separation of the pair of each row's source; NaN without a source."""
    truth = study.truth_of(view)
    separation = truth.group_sep_arcsec[truth.at(rows.field, rows.source_id)]
    return np.where(rows.source_id >= 0, separation, np.nan)


def separated(study: StudyRows, view: View, separation_arcsec: float) -> FloatArray:
    """(n_fields,) pairs of this separation with both members found (or the fainter one, by the view's reading)."""
    truth, rows = study.truth_of(view), study.matches(view)
    is_found = np.zeros(len(truth.field), dtype=bool)
    matched = rows.is_status("matched")
    is_found[truth.at(rows.field[matched], rows.source_id[matched])] = True
    chosen = np.flatnonzero(truth.group_sep_arcsec == separation_arcsec)
    brighter, fainter = _members(truth, chosen)
    counted = is_found[fainter]
    if view.reading != FAINTER_ALONE.name:
        counted = counted & is_found[brighter]
    return np.bincount(truth.field[fainter[counted]], minlength=truth.n_fields).astype(np.float64)


def _members(truth: TruthRows, chosen: Indices) -> tuple[Indices, Indices]:
    """Rows of the brighter and the fainter member of each pair; of equal ones the second counts as fainter."""
    order = chosen[np.lexsort((chosen, -truth.counts_onaxis[chosen], truth.group_id[chosen], truth.field[chosen]))]
    return order[::2], order[1::2]


def flux_scatter(study: StudyRows, view: View, bright: bool) -> FloatArray:
    """(n_fields,) median over the procedures of the scatter of their ratios at 60″."""
    every = []
    for method in view.methods:
        rows = study.matches(view, method)
        chosen = rows.is_status("matched") & (pair_separation(study, view, rows) == WIDE_ARCSEC)
        chosen &= (rows.counts_onaxis >= BRIGHT_COUNTS) == bright
        ratios = Moments.of(rows, chosen, rows.ratio(view))
        every.append(ratios.stdev if view.reading == ABOUT_MEAN.name else _of_two(ratios))
    return nan_median(np.array(every))


def _of_two(ratios: Moments) -> FloatArray:
    """Scatter about unity where there are two values at least."""
    return np.where(ratios.n > 1, ratios.about_unity, np.nan)


def nan_median(values: FloatArray) -> FloatArray:
    """(k,) medians of the columns of (n, k), NaN left out; NaN where all are."""
    result = np.full(values.shape[1], np.nan)
    some = ~np.isnan(values).all(axis=0)
    result[some] = np.nanmedian(values[:, some], axis=0)
    return result


def largest_offset(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) arcsec, 0 without any match."""
    rows = study.matches(view)
    chosen = rows.is_status("matched")
    largest = np.zeros(rows.n_fields)
    np.maximum.at(largest, rows.field[chosen], rows.sep_arcsec[chosen])
    return largest


def loss(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) mean fraction of the counts that is missing."""
    rows = study.matches(view)
    chosen = rows.is_status("matched") & (pair_separation(study, view, rows) > HEW_ARCSEC)
    return 1.0 - Moments.of(rows, chosen, rows.ratio(view)).mean


def half_limit(study: StudyRows, view: View) -> FloatArray:
    """(groups,) expected counts of isolated sources of which half are found."""
    rows = study.matches(view)
    place = COUNTS_BINS.index(rows.counts_expected)
    n_found, n_true, log_centre = binned(rows, place, COUNTS_BINS.size, rows.counts_expected)
    weights = study.groups(rows.n_fields)
    again = crossings(log_centre, whole(weights @ n_found), whole(weights @ n_true))
    return np.asarray(10.0 ** again[:, HALF])


def binned(rows: MatchRows, place: Indices, size: int, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n_fields, size) found and true sources by bin, and (size,) mean log10 of their values; NaN in empty bins."""
    found = rows.is_status("matched")
    used = (found | rows.is_status("missed")) & (place >= 0) & (place < size)

    def by_field(chosen: BoolArray) -> FloatArray:
        flat = np.bincount(rows.field[chosen] * size + place[chosen], minlength=rows.n_fields * size)
        return flat.reshape(rows.n_fields, size).astype(np.float64)

    n_true = by_field(used)
    logs = np.bincount(place[used], weights=np.log10(values[used]), minlength=size)
    return by_field(used & found), n_true, divided(logs.astype(np.float64), n_true.sum(axis=0))


def whole(sums: FloatArray) -> Indices:
    """Weighted sums of whole numbers as whole numbers."""
    return np.rint(sums).astype(np.int64)
