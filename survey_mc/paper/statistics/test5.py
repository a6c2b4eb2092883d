"""Test 5: completeness and confusion of ten shallow and ten deep fields in two bands.

Idea     sums by field and flux bin, then groups of ten fields. What the paper says in words gets a number here:
         confusion     expected minus observed fraction found, from half to twice the published 90 % limit, where the
                       expected fraction is that of isolated sources of the same flux on the grid. Significant: more
                       than 10 %, enough to spoil a 90 % completeness by itself; absent: less than 5 %; marginal:
                       between them.
         agreement     integral counts within 10 % of the input, or 3 Poisson σ of it where that is more, from ten
                       times the printed flux down to the one given: a lack of bright sources, whose Kron counts are
                       low, is another matter than depth.
         numerous      a third of the detections of a flux bin (0.1 dex, 20 detections at least) are false.
Source   paper Sect. 8, Tab. 8.
Limits   the paper does not say which procedure its Fig. of detection rates shows: ours is MR/1+SE, its choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from survey_mc.paper.claims import printed_number
from survey_mc.paper.rows import Indices, MatchRows, Moments, StudyRows, divided
from survey_mc.paper.statistics.statistic import Evidence, Reading, Statistic, Values, within
from survey_mc.paper.statistics.test1 import binned, whole
from survey_mc.paper.statistics.test3 import ABOUT_UNITY
from survey_mc.paper.views import HARD_10, HARD_100, LABELS, SOFT_10, SOFT_100, View, view_of_test_5
from survey_mc.stats.bins import FLUX_BINS, LogBins
from survey_mc.stats.completeness import LEVELS, crossings
from survey_mc.types import BoolArray, FloatArray

LOST_FROM_CGS, LOST_TO_CGS = 3e-16, 6e-16  # Sect. 8
REGION_ARCMIN = 10.0
NINETY = LEVELS.index(0.9)
FINE_BINS = LogBins("flux_cgs", -17, -11, 20)
SIGNIFICANT, ABSENT = 0.10, 0.05
AGREEMENT, AGREEMENT_SIGMA = 0.10, 3.0
NUMEROUS, LEAST_DETECTIONS = 1.0 / 3.0, 20.0

TWENTY_PERCENT = Reading("agreement within 20 %", "integral counts within 20 % instead of 10 %")
CUMULATIVE = Reading("all brighter inputs", "flux above which 90 % of all listed sources together are found")
A_FIFTH = Reading("numerous = a fifth", "a fifth instead of a third of the detections of a flux bin are false")
A_TENTH = Reading("numerous = a tenth", "a tenth instead of a third of the detections of a flux bin are false")
NUMEROUS_BY_READING = {A_FIFTH.name: 0.2, A_TENTH.name: 0.1}
FROM_BRIGHTEST = Reading("from the brightest flux on", "agreement from the brightest flux on")
COMPENSATING = Reading("false compensate the missed", "as many false detections as missed sources in a flux bin")
WORDS = {"soft100": "significant", "hard100": "marginal", "10ks": "absent"}
MEANINGS = {
    "significant": within("significant", SIGNIFICANT, math.inf),
    "marginal": within("marginal", ABSENT, SIGNIFICANT),
    "absent": within("absent", -math.inf, ABSENT),
}


def evidence() -> Iterator[Evidence]:
    """The claims test5.*."""
    for cell in (SOFT_10, HARD_10, SOFT_100, HARD_100):
        yield _groups(
            _limit_claim(cell), "flux at which the completeness of MR/1+SE in ten fields passes 90 %",
            limit_90, view_of_test_5(cell), CUMULATIVE,
        )  # fmt: skip
    yield _groups(
        "test5.lost",
        "fraction of the listed sources from 3e-16 to 6e-16 that is missed",
        lost,
        view_of_test_5(SOFT_100),
    )
    for name, cells in {"soft100": (SOFT_100,), "hard100": (HARD_100,), "10ks": (SOFT_10, HARD_10)}.items():
        word = WORDS[name]
        about = "isolated minus field completeness, half to twice the published limit" + (
            ", the larger of both bands" if len(cells) > 1 else ""
        )
        yield Statistic(
            f"test5.confusion.{name}", f"{about}; {word}: {_words(word)}", "groups of ten fields", confusion,
            view_of_test_5(*cells, grid=True), meaning=MEANINGS[word],
        )  # fmt: skip
    for method in ("mr1_se", "emldetect"):
        for cell in (SOFT_10, SOFT_100):
            yield _groups(
                name := f"test5.lognlogs.{method}.{cell.split('-')[-1]}",
                "flux down to which, from ten times the printed one, the integral counts stay within 10 % (or 3σ)",
                partial(agreement, from_cgs=10.0 * printed_number(name)),
                view_of_test_5(cell, method=LABELS[method]), TWENTY_PERCENT, FROM_BRIGHTEST,
            )  # fmt: skip
    yield _groups(
        "test5.eml.spurious", "upper edge of the brightest flux bin in which a third of the detections are false",
        numerous_below, view_of_test_5(SOFT_100, method=LABELS["emldetect"]), COMPENSATING, A_FIFTH, A_TENTH,
    )  # fmt: skip
    yield _groups(
        "test5.photometry", "standard deviation of measured/input counts above the published limit, mean of 10, 100 ks",
        photometry, view_of_test_5(SOFT_10, SOFT_100), ABOUT_UNITY,
    )  # fmt: skip


def _limit_claim(cell: str) -> str:
    """The claim of the 90 % limit of a cell (Tab. 8)."""
    _, band, exposure = cell.split("-")
    return f"test5.limit90.{band}.{exposure}"


def _groups(claim: str, about: str, values: Values, view: View, *readings: Reading) -> Statistic:
    return Statistic(claim, about, "groups of ten fields", values, view, readings)


def _words(word: str) -> str:
    return {"significant": "> 0.10", "marginal": "0.05 to 0.10", "absent": "< 0.05"}[word]


def limit_90(study: StudyRows, view: View) -> FloatArray:
    """(groups,) erg/cm²/s; 0 or inf where 90 % is passed nowhere."""
    rows = study.matches(view)
    weights = study.groups(rows.n_fields)
    if view.reading == CUMULATIVE.name:
        return _limit_of_all_brighter(rows, weights)
    place = FLUX_BINS.index(rows.flux_true_cgs)
    n_found, n_true, log_centre = binned(rows, place, FLUX_BINS.size, rows.flux_true_cgs)
    again = crossings(log_centre, whole(weights @ n_found), whole(weights @ n_true))
    return np.asarray(10.0 ** again[:, NINETY])


def _limit_of_all_brighter(rows: MatchRows, weights: FloatArray) -> FloatArray:
    """(groups,) erg/cm²/s: faintest edge above which 90 % of the sources are found; inf if it is nowhere so."""
    n_found, n_true, _ = binned(rows, FINE_BINS.index(rows.flux_true_cgs), FINE_BINS.size, rows.flux_true_cgs)
    n_above = _above(weights @ n_true)
    fraction = divided(_above(weights @ n_found), n_above)
    enough = (n_above > 0) & (fraction >= LEVELS[NINETY])
    edges = FINE_BINS.edges[:-1][np.argmax(enough, axis=1)]
    return np.where(enough.any(axis=1), edges, np.inf)


def lost(study: StudyRows, view: View) -> FloatArray:
    """(groups,) fraction missed."""
    rows = study.matches(view)
    between = (rows.flux_true_cgs >= LOST_FROM_CGS) & (rows.flux_true_cgs < LOST_TO_CGS)
    weights = study.groups(rows.n_fields)
    n_missed, n_found = (weights @ rows.per_field(between & rows.is_status(s)) for s in ("missed", "matched"))
    return divided(n_missed, n_missed + n_found)


def confusion(study: StudyRows, view: View) -> FloatArray:
    """(groups,) fraction of sources lost to neighbours; the largest over the view's cells."""
    return np.asarray(np.max([_confusion(study, view, cell) for cell in view.cells], axis=0))


def _confusion(study: StudyRows, view: View, cell: str) -> FloatArray:
    limit = printed_number(_limit_claim(cell))
    rows = study.matches(view, cell=cell)
    in_range = (rows.flux_true_cgs >= limit / 2.0) & (rows.flux_true_cgs <= 2.0 * limit)
    place = np.where(in_range, FINE_BINS.index(rows.flux_true_cgs), -1)
    n_found, n_true, _ = binned(rows, place, FINE_BINS.size, rows.flux_true_cgs)
    weights = study.groups(rows.n_fields)
    n_true_again = weights @ n_true
    expected = (n_true_again * _isolated(study, view, cell)).sum(axis=1)
    return divided(expected - (weights @ n_found).sum(axis=1), n_true_again.sum(axis=1))


def _isolated(study: StudyRows, view: View, cell: str) -> FloatArray:
    """(bins,) fraction of isolated sources found at the centre of each fine bin.

    Of all grid fields: the paper does not say how many images its grid has, and its curve is smooth.
    """
    rows = study.rows_of(view.grid, view.method, cell, view.rule)
    listed = rows.is_status("matched", "missed")
    fluxes = np.unique(rows.flux_true_cgs[listed])
    place = np.searchsorted(fluxes, rows.flux_true_cgs)
    n_found, n_true, _ = binned(rows, place, len(fluxes), rows.flux_true_cgs)
    fraction = divided(n_found.sum(axis=0), n_true.sum(axis=0))
    centre = np.log10(FINE_BINS.edges[:-1] * FINE_BINS.edges[1:]) / 2.0
    return _interpolated(centre, np.log10(fluxes), fraction)


def _interpolated(x: FloatArray, at: FloatArray, values: FloatArray) -> FloatArray:
    known = np.isfinite(values)
    return np.asarray(np.interp(x, at[known], values[known]), dtype=np.float64)


def agreement(study: StudyRows, view: View, from_cgs: float) -> FloatArray:
    """(groups,) erg/cm²/s: lower edge of the faintest bin down to which the integral counts agree; inf for none."""
    tolerance = 2.0 * AGREEMENT if view.reading == TWENTY_PERCENT.name else AGREEMENT
    rows, truth = study.matches(view), study.truth_of(view)
    weights = study.groups(rows.n_fields)
    inside = truth.offaxis_arcmin <= REGION_ARCMIN
    n_input = _above(weights @ _histogram(truth.field[inside], truth.flux_cgs[inside], rows.n_fields, FINE_BINS))
    found = _in_region(rows)
    n_found = _above(weights @ _histogram(rows.field[found], rows.flux_cgs[found], rows.n_fields, FINE_BINS))
    allowed = np.maximum(tolerance * n_input, AGREEMENT_SIGMA * np.sqrt(n_input))
    disagrees = np.abs(n_found - n_input) > np.maximum(allowed, AGREEMENT_SIGMA)
    faintest = np.flatnonzero(n_input.any(axis=0))[0] if n_input.any() else 0
    if view.reading != FROM_BRIGHTEST.name:
        disagrees[:, FINE_BINS.edges[:-1] > from_cgs] = False
    disagrees[:, :faintest] = True
    last = np.where(disagrees.any(axis=1), disagrees.shape[1] - 1 - np.argmax(disagrees[:, ::-1], axis=1), -1)
    return np.asarray(np.append(FINE_BINS.edges[:-1], np.inf)[last + 1])


def _in_region(rows: MatchRows) -> BoolArray:
    return np.asarray((rows.det_id >= 0) & (rows.offaxis_arcmin <= REGION_ARCMIN))


def _histogram(field: Indices, flux_cgs: FloatArray, n_fields: int, bins: LogBins) -> FloatArray:
    """(n_fields, bins) numbers by field and flux; what is brighter than the last edge is in the last bin."""
    place = np.minimum(bins.index(flux_cgs), bins.size - 1)
    used = place >= 0
    flat = np.bincount(field[used] * bins.size + place[used], minlength=n_fields * bins.size)
    return flat.reshape(n_fields, bins.size).astype(np.float64)


def _above(numbers: FloatArray) -> FloatArray:
    """Numbers at and above each bin."""
    return np.asarray(np.cumsum(numbers[:, ::-1], axis=1)[:, ::-1])


def numerous_below(study: StudyRows, view: View) -> FloatArray:
    """(groups,) erg/cm²/s; 0 where false detections are numerous nowhere."""
    rows = study.matches(view)
    weights = study.groups(rows.n_fields)

    def drawn(chosen: BoolArray, flux_cgs: FloatArray) -> FloatArray:
        return np.asarray(weights @ _histogram(rows.field[chosen], flux_cgs[chosen], rows.n_fields, FLUX_BINS))

    found = _in_region(rows)
    n_false, n_found = drawn(found & rows.is_status(*view.false), rows.flux_cgs), drawn(found, rows.flux_cgs)
    if view.reading == COMPENSATING.name:
        enough = (n_false >= drawn(rows.is_status("missed"), rows.flux_true_cgs)) & (n_false > 0)
    else:
        enough = n_false >= NUMEROUS_BY_READING.get(view.reading, NUMEROUS) * n_found
    enough &= n_found >= LEAST_DETECTIONS
    brightest = enough.shape[1] - 1 - np.argmax(enough[:, ::-1], axis=1)
    return np.where(enough.any(axis=1), FLUX_BINS.edges[1:][brightest], 0.0)


def photometry(study: StudyRows, view: View) -> FloatArray:
    """(groups,) scatter of the ratios above the limits, mean over the view's cells."""
    return np.asarray(np.mean([_scatter(study, view, cell) for cell in view.cells], axis=0))


def _scatter(study: StudyRows, view: View, cell: str) -> FloatArray:
    rows = study.matches(view, cell=cell)
    bright = rows.is_status("matched") & (rows.flux_true_cgs >= printed_number(_limit_claim(cell)))
    ratios = Moments.of(rows, bright, rows.ratio(view)).drawn(study.groups(rows.n_fields))
    return ratios.about_unity if view.reading == ABOUT_UNITY.name else ratios.stdev
