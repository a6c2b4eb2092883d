"""Test 4: five clusters among the points of Test 3, one image.

Idea     of each cluster the detection nearest to it within 20″: its offset, and its counts over the cluster's input
         counts (rate × exposure, without vignetting, as Tab. 7 has them).
Source   paper Sect. 7, Tab. 7.
Limits   the positions of the paper's clusters are not printed: ours are random inside 8′, so vignetting and neighbours
         differ from image to image, and the spread of single images holds them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from survey_mc.paper.claims import load_claims
from survey_mc.paper.rows import Indices, StudyRows
from survey_mc.paper.statistics.statistic import Evidence, Reading, Statistic, within
from survey_mc.paper.study import TEST_4
from survey_mc.paper.views import LABELS, View
from survey_mc.types import FloatArray

METHODS = ("emldetect", "gauss_se", "mr1_se", "wavdetect")
REDSHIFTS = (0.6, 1.0, 1.5, 1.8, 2.0)
RADIUS_ARCSEC = 20.0
NOT_DETECTED = "not detected"

ALL_PIECES = Reading("counts of all detections within 20″", "the counts of all detections within 20″ are added")
BRIGHTEST = Reading("brightest detection within 20″", "the brightest instead of the nearest detection within 20″")


def evidence() -> Iterator[Evidence]:
    """The claims test4.<method>.z<redshift>.*."""
    unseen = {claim.id for claim in load_claims() if claim.published.text == NOT_DETECTED}
    for name in METHODS:
        for redshift in REDSHIFTS:
            yield from _cluster(f"test4.{name}.z{redshift:.1f}", View(TEST_4, (LABELS[name],)), redshift, unseen)


def _cluster(claim: str, view: View, redshift: float, unseen: set[str]) -> Iterator[Evidence]:
    nearest = "the detection nearest to the cluster within 20″"
    about = {"offset": f"distance of {nearest}", "ratio": f"measured/input counts of {nearest}"}
    values = {"offset": offset, "ratio": ratio}
    readings = {"offset": (BRIGHTEST,), "ratio": (BRIGHTEST, ALL_PIECES)}
    for kind in ("offset", "ratio"):
        name = f"{claim}.{kind}"
        if name in unseen:
            yield Statistic(
                name, "1 if there is a detection within 20″, else 0", "single images",
                partial(detected, redshift=redshift), view, meaning=within(NOT_DETECTED, 0.0, 0.0),
            )  # fmt: skip
        else:
            yield Statistic(
                name, f"{about[kind]}; images without one left out", "single images",
                partial(values[kind], redshift=redshift), view, readings[kind],
            )  # fmt: skip


def detected(study: StudyRows, view: View, redshift: float) -> FloatArray:
    """(n_fields,) 1 where the cluster is detected."""
    return (_chosen(study, view, redshift)[0] >= 0).astype(np.float64)


def offset(study: StudyRows, view: View, redshift: float) -> FloatArray:
    """(n_fields,) arcsec; NaN where the cluster is not detected."""
    return _chosen(study, view, redshift)[1]


def ratio(study: StudyRows, view: View, redshift: float) -> FloatArray:
    """(n_fields,) measured over input counts; NaN where the cluster is not detected."""
    truth = study.truth_of(view)
    input_counts = getattr(truth, view.input_counts)[_clusters(study, view, redshift)]
    if view.reading == ALL_PIECES.name:
        field, det_id, _ = _candidates(study, view, redshift)
        counts = np.bincount(field, _counts(study, view, field, det_id), truth.n_fields)
        return np.where(counts > 0, counts / input_counts, np.nan)
    det_id, _ = _chosen(study, view, redshift)
    return np.asarray(_counts(study, view, np.arange(truth.n_fields), det_id) / input_counts)


def _counts(study: StudyRows, view: View, field: Indices, det_id: Indices) -> FloatArray:
    """(n,) counts of detections, corrected for vignetting if the view asks for it."""
    if view.measured_counts == "counts":
        return study.of_detections(view, "counts", field, det_id)
    return study.of_detections(view, "rate_cps", field, det_id) * study.exposure_s(view)


def _clusters(study: StudyRows, view: View, redshift: float) -> Indices:
    """(n_fields,) rows of the cluster of this redshift."""
    return np.flatnonzero(study.truth_of(view).redshift == redshift)


def _candidates(study: StudyRows, view: View, redshift: float) -> tuple[Indices, Indices, FloatArray]:
    """Field, number and distance (arcsec) of all detections within 20″, nearest first in each field."""
    links = study.links_to_clusters(View(view.campaign, (view.method,), view.cells))
    is_cluster = study.truth_of(view).redshift[links.source] == redshift
    used = is_cluster & (links.sep_arcsec <= RADIUS_ARCSEC)
    return links.field[used], links.det_id[used], links.sep_arcsec[used]


def _chosen(study: StudyRows, view: View, redshift: float) -> tuple[Indices, FloatArray]:
    """(n_fields,) number (-1: none) and distance (NaN) of the detection that stands for the cluster."""
    n_fields = study.n_fields(view)
    if view.rule == "origin":
        field, det_id, sep_arcsec = _by_origin(study, view, redshift)
    else:
        field, det_id, sep_arcsec = _candidates(study, view, redshift)
        if view.reading == BRIGHTEST.name:
            order = np.lexsort((-_counts(study, view, field, det_id), field))
            field, det_id, sep_arcsec = field[order], det_id[order], sep_arcsec[order]
    found, first = np.unique(field, return_index=True)
    number, distance = np.full(n_fields, -1, dtype=np.int64), np.full(n_fields, np.nan)
    number[found], distance[found] = det_id[first], sep_arcsec[first]
    return number, distance


def _by_origin(study: StudyRows, view: View, redshift: float) -> tuple[Indices, Indices, FloatArray]:
    """Field, number and distance of the detections that rest on the cluster's photons, at any distance."""
    rows, truth = study.matches(view), study.truth_of(view)
    is_cluster = truth.redshift[truth.at(rows.field, rows.source_id)] == redshift
    used = rows.is_status("matched") & is_cluster & (rows.source_id >= 0)
    return rows.field[used], rows.det_id[used], rows.sep_arcsec[used]
