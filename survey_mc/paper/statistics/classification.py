"""Point or extended: the paper's cut on the detections of ten fields without clusters.

Idea     stellarity below 0.1 and half-light radius of at least 20″, more than 20 measured counts, inside 10′; every
         such detection in a field of points is wrong.
Source   paper Sect. 7.3 and abstract.
Limits   the paper divides the wrong ones by all detections of the image, also those that the cut does not judge.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from survey_mc.paper.rows import Indices, StudyRows, divided
from survey_mc.paper.statistics.statistic import Evidence, Reading, Statistic
from survey_mc.paper.study import TEST_3
from survey_mc.paper.views import View
from survey_mc.stats.classification import PAPER_CUT
from survey_mc.types import BoolArray, FloatArray

R50_ALONE = Reading("r50 alone", "half-light radius of at least 20″, whatever the stellarity")
STELLARITY_ALONE = Reading("stellarity alone", "stellarity below 0.1, whatever the half-light radius")
WHOLE_IMAGE = Reading("whole image", "detections at any off-axis angle")
JUDGED = Reading("judged detections", "divided by the detections that the cut judges: more than 20 counts, inside 10′")


def evidence() -> Iterator[Evidence]:
    """The claims test4.class.* and test4.n_det."""
    view = View(TEST_3)
    cuts = (R50_ALONE, STELLARITY_ALONE, WHOLE_IMAGE)
    wrong = "detections of ten fields of points that the cut calls extended"
    yield Statistic("test4.class.wrong", wrong, "groups of ten fields", wrong_detections, view, cuts)
    right = f"1 − {wrong}, over all detections of the ten images"
    yield Statistic("test4.class.right", right, "groups of ten fields", right_fraction, view, (*cuts, JUDGED))
    yield Statistic(
        "test4.n_det",
        "detections in the whole images of ten fields of points",
        "groups of ten fields",
        detections,
        view,
    )


def _called_extended(study: StudyRows, view: View) -> tuple[BoolArray, BoolArray, Indices]:
    """Of each detection: whether it is called extended, whether it is judged at all, and its field."""
    frame = study.detections(view.campaign, view.method, view.cell)
    names = ("stellarity", "r50_arcsec", "counts", "offaxis_arcmin")
    stellarity, r50_arcsec, counts, offaxis = (frame[name].to_numpy(np.float64) for name in names)
    if view.reading == R50_ALONE.name:
        stellarity = np.zeros_like(stellarity)
    if view.reading == STELLARITY_ALONE.name:
        r50_arcsec = np.full_like(r50_arcsec, np.inf)
    if view.reading == WHOLE_IMAGE.name:
        offaxis = np.zeros_like(offaxis)
    is_called = PAPER_CUT.called_extended(stellarity, r50_arcsec, counts, offaxis)
    return is_called, PAPER_CUT.applies(counts, offaxis), frame["realisation"].to_numpy(np.int64)


def _drawn(study: StudyRows, view: View, chosen: BoolArray, field: Indices) -> FloatArray:
    n_fields = study.n_fields(view)
    number = np.bincount(field[chosen], minlength=n_fields).astype(np.float64)
    return np.asarray(study.groups(n_fields) @ number)


def wrong_detections(study: StudyRows, view: View) -> FloatArray:
    """(groups,) wrong calls in ten fields."""
    is_called, _, field = _called_extended(study, view)
    return _drawn(study, view, is_called, field)


def right_fraction(study: StudyRows, view: View) -> FloatArray:
    """(groups,) 1 − wrong calls over detections."""
    is_called, is_judged, field = _called_extended(study, view)
    tried = is_judged if view.reading == JUDGED.name else np.ones(len(field), dtype=bool)
    return 1.0 - divided(_drawn(study, view, is_called, field), _drawn(study, view, tried, field))


def detections(study: StudyRows, view: View) -> FloatArray:
    """(groups,) detections of ten images."""
    frame = study.detections(view.campaign, view.method, view.cell)
    return _drawn(study, view, np.ones(len(frame), dtype=bool), frame["realisation"].to_numpy(np.int64))
