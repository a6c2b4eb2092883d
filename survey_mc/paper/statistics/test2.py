"""Test 2: point sources beside clusters, one image.

Source   paper Sect. 5, Tab. 5 (search radius 20″).
Limits   core radius and counts of the paper's clusters are in its figure only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from survey_mc.match.outcome import MATCHED, MISSED
from survey_mc.paper.rows import NUMBERS_PER_FIELD, MatchRows, Moments, StudyRows, divided
from survey_mc.paper.statistics.statistic import Evidence, Reading, Statistic
from survey_mc.paper.statistics.test1 import ABOUT_MEAN, false, pair_separation
from survey_mc.paper.study import TEST_2
from survey_mc.paper.views import LABELS, View
from survey_mc.types import FloatArray

RADIUS_ARCSEC = 20.0
METHODS = tuple(name for name in LABELS if name != "vtpdetect")  # left out after Test 1
LARGEST = Reading("largest ratio", "the largest ratio of an image instead of the mean")
CLUSTERS_FIRST = Reading(
    "clusters first", "a detection within 20″ of a cluster is the cluster's, the nearest one to it"
)
BOTH_MEMBERS = Reading("photons of both members", "detected over input counts of point and cluster together")


def evidence() -> Iterator[Evidence]:
    """The claims test2.*."""
    for name in METHODS:
        view = View(TEST_2, (LABELS[name],))
        for kind, extended in (("point", False), ("ext", True)):
            about = f"listed {'clusters' if extended else 'point sources'} without a detection in one image"
            yield Statistic(
                f"test2.{name}.missed_{kind}", about, "single images", partial(missed, extended=extended), view,
                (CLUSTERS_FIRST,),
            )  # fmt: skip
        about = "detections without a listed source within 20″ in one image"
        yield Statistic(f"test2.{name}.false", about, "single images", false, view)
    mr1, wavdetect = View(TEST_2, (LABELS["mr1_se"],)), View(TEST_2, (LABELS["wavdetect"],))
    yield Statistic(
        "test2.mr1.flux60", "rms of (measured/input counts − 1) of the clusters at 60″", "single images",
        cluster_scatter, mr1, (ABOUT_MEAN, CLUSTERS_FIRST),
    )  # fmt: skip
    yield Statistic(
        "test2.wav.flux15", "1 − measured/input counts of the clusters found at 15″, summed", "single images",
        cluster_loss, wavdetect, (BOTH_MEMBERS, CLUSTERS_FIRST),
    )  # fmt: skip
    yield Statistic(
        "test2.mr1.r30_points", "mean measured/input counts of the point sources found at 30″", "single images",
        point_excess, mr1, (LARGEST, CLUSTERS_FIRST),
    )  # fmt: skip


def missed(study: StudyRows, view: View, extended: bool) -> FloatArray:
    """(n_fields,) missed sources of one kind."""
    rows = _rows(study, view)
    return rows.per_field(rows.is_status("missed") & (rows.is_extended == extended))


def cluster_scatter(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) scatter of the clusters' ratios at 60″; NaN for fewer than two."""
    rows = _rows(study, view)
    chosen = rows.is_status("matched") & rows.is_extended & (pair_separation(study, view, rows) == 60.0)
    ratios = Moments.of(rows, chosen, rows.ratio(view))
    return ratios.stdev if view.reading == ABOUT_MEAN.name else np.where(ratios.n > 1, ratios.about_unity, np.nan)


def cluster_loss(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) fraction of the counts that is missing; NaN where nothing was found."""
    rows = _rows(study, view)
    near = pair_separation(study, view, rows) == 15.0
    found = rows.is_status("matched", "duplicate") & near
    tried = rows.is_status("matched", "missed") & near
    if view.reading != BOTH_MEMBERS.name:
        found &= rows.is_extended & rows.is_status("matched")
        tried = found
    detected = rows.summed(found, getattr(rows, view.measured_counts))
    return 1.0 - divided(detected, rows.summed(tried, getattr(rows, view.input_counts)))


def point_excess(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) mean or largest ratio of the points at 30″; NaN where none was found."""
    rows = _rows(study, view)
    chosen = rows.is_status("matched") & ~rows.is_extended & (pair_separation(study, view, rows) == 30.0)
    ratio = rows.ratio(view)
    if view.reading != LARGEST.name:
        return Moments.of(rows, chosen, ratio).mean
    largest = np.full(rows.n_fields, np.nan)
    np.fmax.at(largest, rows.field[chosen], ratio[chosen])
    return largest


def _rows(study: StudyRows, view: View) -> MatchRows:
    """The matches of a view, assigned anew if its reading gives clusters the first choice."""
    rows = study.matches(view)
    return _clusters_first(study, view, rows) if view.reading == CLUSTERS_FIRST.name else rows


def _clusters_first(study: StudyRows, view: View, rows: MatchRows) -> MatchRows:
    """Matches and missed sources when each cluster takes the nearest detection within 20″, then each point the
    nearest one left. Rows: one for each source, its detection's counts if it has one.
    """
    truth, links = study.truth_of(view), study.links(view)
    chosen = np.full(len(truth.field), -1, dtype=np.int64)
    taken: set[tuple[int, int]] = set()
    for i in np.lexsort((links.det_id, links.sep_arcsec, ~truth.is_extended[links.source])):
        detection, source = (int(links.field[i]), int(links.det_id[i])), links.source[i]
        if links.sep_arcsec[i] <= RADIUS_ARCSEC and chosen[source] < 0 and detection not in taken:
            chosen[source] = links.det_id[i]
            taken.add(detection)
    rate_cps = study.of_detections(view, "rate_cps", truth.field, chosen)
    unknown = np.full(len(truth.field), np.nan)
    return replace(
        rows,
        field=truth.field,
        status=np.where(chosen >= 0, MATCHED, MISSED).astype(np.int8),
        is_extended=truth.is_extended,
        source_id=truth.key % NUMBERS_PER_FIELD,
        det_id=chosen,
        sep_arcsec=unknown,
        flux_cgs=unknown,
        flux_true_cgs=truth.flux_cgs,
        offaxis_arcmin=truth.offaxis_arcmin,
        counts_onaxis=truth.counts_onaxis,
        counts_expected=truth.counts_expected,
        counts=study.of_detections(view, "counts", truth.field, chosen),
        counts_corrected=rate_cps * study.exposure_s(view),
    )
