"""Test 4 of the paper: the field of Test 3 with five clusters of galaxies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.paper.figures.classification import (
    COUNTS_CUT,
    REGION_ARCMIN,
    Marked,
    Panel,
    classification_figure,
    extent_panels,
    found_of,
    statistic,
)
from survey_mc.paper.figures.images import DEEP_COUNTS_MIN, DEEP_FACTOR, DrawnField, first_field
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import CHOSEN, FIRST, column, detections, fields_phrase, procedure, procedures, truth
from survey_mc.paper.figures.sheet import drawing
from survey_mc.paper.figures.test3 import field_images
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_3, TEST_4
from survey_mc.units import ARCSEC_PER_ARCMIN

if TYPE_CHECKING:
    from pandas import DataFrame

WIDE_SMOOTHING = ("test3_options", "G+SE 20 arcsec")  # where the point-only fields were searched as in Test 4
R50_CUT_ARCSEC, STELLARITY_CUT = 20.0, 0.1  # paper Sect. 7.3
WRITING = "#9a3d00"


def test4_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """Images, and the classification by the two SExtractor-based procedures."""
    with drawing():
        drawn = first_field(results, TEST_4)
        yield PaperFigure(
            "test4_images",
            "Test 4: points and clusters of galaxies, four images",
            f"The paper's Fig. 10. The first image of {TEST_4}: the point sources of Test 3 and five clusters "
            f"(β-models) at the redshifts written below them; panels as in Test 3 (photons; "
            f"{DEEP_FACTOR:g} times the exposure without background, sources above {DEEP_COUNTS_MIN:g} input counts; "
            "MR/1; WAVDETECT with its detections). The paper does not give the positions of the clusters: ours are "
            "random.",
            _cluster_images(results, drawn),
        )
        if results.has(TEST_3):
            yield from _classification(results)


def _cluster_images(results: StudyResults, drawn: DrawnField) -> Any:
    figure = field_images(results, TEST_4, drawn)
    sources = truth(results, TEST_4)
    clusters = sources[(sources["realisation"] == FIRST) & (sources["kind"] == "extended")]
    for axes in figure.axes[:2]:
        for x_arcsec, y_arcsec, redshift in clusters[["x_arcsec", "y_arcsec", "redshift"]].to_numpy(np.float64):
            axes.annotate(
                f"z = {redshift:.1f}", (x_arcsec / ARCSEC_PER_ARCMIN, y_arcsec / ARCSEC_PER_ARCMIN), (0, -17),
                textcoords="offset points", ha="center", fontsize=8.0, fontweight="bold", color=WRITING,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
            )  # fmt: skip
    return figure


def _classification(results: StudyResults) -> Iterator[PaperFigure]:
    for name, stem, words, source in (
        (CHOSEN, "test4_classification_mr1", "The paper's Fig. 11.", _point_fields(results, CHOSEN)),
        ("gauss_se", "test4_classification_gauss", "Beyond the paper, for G+SE.", _wide_point_fields(results)),
    ):
        chosen = procedure(results, TEST_4, name)
        if chosen is None or source is None:
            continue
        cloud = detections(results, *source)
        marks = (Marked("extended", found_of(results, TEST_4, chosen.label, "extended")),)
        panels = extent_panels([Panel(chosen, statistic(name, c), cloud, marks) for c in ("r50_arcsec", "stellarity")])
        if panels:
            title = f"Test 4: extended or not, {chosen.label}"
            yield PaperFigure(stem, title, _caption(results, words, source, cloud), classification_figure(panels))


def _caption(results: StudyResults, words: str, source: tuple[str, str], cloud: DataFrame) -> str:
    wrong, judged = wrong_points(cloud)
    campaign, label = source
    return (
        f"{words} Half-light radius and stellarity index (0 extended, 1 point) against off-axis angle and detected "
        f"counts. Grey: the {len(cloud)} detections in {fields_phrase(results.n_fields(campaign))} of point sources "
        f"only ({label} of {campaign}; thinned to 3000); filled circles: the clusters found in the first image of "
        f"{TEST_4}, small ones: in its other images (thinned to 600). Dashed: the paper's cuts. Of the point-only "
        f"detections {wrong} pass for extended (stellarity < {STELLARITY_CUT:g}, R50 ≥ {R50_CUT_ARCSEC:g}″) among "
        f"{judged} inside {REGION_ARCMIN:g}′ with more than {COUNTS_CUT:g} counts; the paper: 15, of 1287 detections "
        "of MR/1+SE in ten whole images."
    )


def wrong_points(cloud: DataFrame) -> tuple[int, int]:
    """Detections of point-only fields that pass for extended by the paper's cut, and how many were judged."""
    judged = (column(cloud, "offaxis_arcmin") < REGION_ARCMIN) & (column(cloud, "counts") > COUNTS_CUT)
    extended = (column(cloud, "r50_arcsec") >= R50_CUT_ARCSEC) & (column(cloud, "stellarity") < STELLARITY_CUT)
    return int((judged & extended).sum()), int(judged.sum())


def _point_fields(results: StudyResults, name: str) -> tuple[str, str] | None:
    """Campaign and label of a procedure's detections in fields of point sources only."""
    chosen = procedure(results, TEST_3, name)
    return None if chosen is None else (TEST_3, chosen.label)


def _wide_point_fields(results: StudyResults) -> tuple[str, str] | None:
    """The same for G+SE with the Gaussian of Test 4; with that of Test 3 where the option was not run."""
    campaign, label = WIDE_SMOOTHING
    if results.has(campaign) and label in {p.label for p in procedures(results, campaign)}:
        return WIDE_SMOOTHING
    return _point_fields(results, "gauss_se")
