"""Test 3: a shallow field of point sources, one image.

Source   paper Sect. 6, Tab. 6.
Limits   "one sigma positional error" is not defined: ours is the rms separation of matches of more than 100 input
         counts, other readings beside it. A separation beyond the search radius of 6″ is no match and cuts them all.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from survey_mc.paper.rows import Indices, MatchRows, Moments, StudyRows, divided
from survey_mc.paper.statistics.statistic import Evidence, Reading, Statistic
from survey_mc.paper.study import TEST_3
from survey_mc.paper.views import LABELS, View
from survey_mc.telescope import INSTRUMENTS
from survey_mc.types import BoolArray, FloatArray

METHODS = ("emldetect", "gauss_se", "mr1_se", "wavdetect")
BRIGHT_COUNTS, PHOTOMETRY_COUNTS = 100.0, 50.0  # Sects. 6.2 and 6.3
BELIEVED_PSF = "test3_believed_psf"
SCALE_ARCSEC = INSTRUMENTS["xmm_epic"].scale_arcsec
SLIP_ARCSEC = SCALE_ARCSEC / 2.0
ONE_SIGMA_RANK = 0.6827

MEAN = Reading("mean separation", "mean instead of rms separation")
RADIUS_68 = Reading("68 % radius", "radius that holds 68 % of the separations")
PER_AXIS = Reading("per axis", "rms along one axis: the rms separation over √2")
SPREAD = Reading("spread of the separations", "standard deviation of the separations about their mean")
LARGEST = Reading("largest separation", "the largest separation")
SLIP = Reading("half a pixel off", "rms separation with all detections half a pixel (2″) too far in x and in y")
MEASURED = Reading("more than 100 measured counts", "detections of more than 100 measured instead of input counts")
ABOUT_UNITY = Reading("scatter about unity", "rms of (measured/input − 1) instead of the standard deviation")


def evidence() -> Iterator[Evidence]:
    """The claims test3.*."""
    for name in METHODS:
        view = View(TEST_3, (LABELS[name],))
        yield Statistic(
            f"test3.{name}.pos_error", "rms separation of matches of more than 100 input counts in one image",
            "single images", position_error, view, (MEAN, RADIUS_68, PER_AXIS, SPREAD, LARGEST, SLIP, MEASURED),
        )  # fmt: skip
        yield Statistic(
            f"test3.{name}.number", "matches of more than 100 input counts in one image", "single images",
            number, view, (MEASURED,),
        )  # fmt: skip
    scatter = "standard deviation of measured/input counts of matches of more than 50 input counts in one image"
    yield Statistic(
        "test3.wt.flux", f"{scatter}, mean of both procedures", "single images", flux_scatter,
        View(TEST_3, (LABELS["mr1_se"], LABELS["wavdetect"])), (ABOUT_UNITY,),
    )  # fmt: skip
    yield Statistic(
        "test3.eml.flux", f"{scatter}; PSF of 4.3″ and 13.8″ believed", "single images", flux_scatter,
        View(BELIEVED_PSF, (LABELS["emldetect"],)), (ABOUT_UNITY,),
    )  # fmt: skip
    others = tuple(LABELS[name] for name in METHODS if name != "gauss_se")
    yield Statistic(
        "test3.gse.false", "false detections of G+SE over the mean of EMLDETECT, MR/1+SE and WAVDETECT in one image",
        "single images", false_ratio, View(TEST_3, (LABELS["gauss_se"], *others), beside=TEST_3),
    )  # fmt: skip


def _bright(rows: MatchRows, view: View) -> BoolArray:
    counts: FloatArray = rows.counts if view.reading == MEASURED.name else getattr(rows, view.input_counts)
    return np.asarray(rows.is_status("matched") & (counts > BRIGHT_COUNTS))


def number(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) bright matches."""
    rows = study.matches(view)
    return rows.per_field(_bright(rows, view))


def position_error(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) arcsec, by the view's reading; NaN without a bright match."""
    rows = study.matches(view)
    chosen = _bright(rows, view)
    if view.reading == SLIP.name:
        return Moments.of(rows, chosen, _slipped(study, view, rows)).rms
    if view.reading in (RADIUS_68.name, LARGEST.name):
        rank = ONE_SIGMA_RANK if view.reading == RADIUS_68.name else 1.0
        return _ranked(rows.field[chosen], rows.sep_arcsec[chosen], rows.n_fields, rank)
    sums = Moments.of(rows, chosen, rows.sep_arcsec)
    if view.reading == MEAN.name:
        return sums.mean
    if view.reading == SPREAD.name:
        return sums.stdev
    return sums.rms / (np.sqrt(2.0) if view.reading == PER_AXIS.name else 1.0)


def _ranked(field: Indices, values: FloatArray, n_fields: int, rank: float) -> FloatArray:
    """(n_fields,) quantile of each field's values; NaN without any."""
    result = np.full(n_fields, np.nan)
    for i in np.unique(field):
        result[i] = np.quantile(values[field == i], rank)
    return result


def _slipped(study: StudyRows, view: View, rows: MatchRows) -> FloatArray:
    """(n,) arcsec: separations after moving every detection by half a pixel along x and y."""
    truth = study.truth_of(view)
    source = truth.at(rows.field, rows.source_id)
    offsets = []
    for axis, true in (("x_pix", truth.x_pix), ("y_pix", truth.y_pix)):
        found_pix = study.of_detections(view, axis, rows.field, rows.det_id)
        offsets.append((found_pix - true[source]) * SCALE_ARCSEC + SLIP_ARCSEC)
    return np.asarray(np.hypot(*offsets))


def flux_scatter(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) mean over the procedures of the scatter of their ratios above 50 input counts."""
    every = []
    for method in view.methods:
        rows = study.matches(view, method)
        counts: FloatArray = getattr(rows, view.input_counts)
        ratios = Moments.of(rows, rows.is_status("matched") & (counts > PHOTOMETRY_COUNTS), rows.ratio(view))
        every.append(ratios.about_unity if view.reading == ABOUT_UNITY.name else ratios.stdev)
    return np.asarray(np.mean(every, axis=0))


def false_ratio(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) false detections of the first procedure over the mean of the others; NaN where these have none."""
    every = []
    for method in view.methods:
        rows = study.matches(view, method)
        every.append(rows.per_field(rows.is_status(*view.false)))
    return divided(every[0], np.mean(every[1:], axis=0))
