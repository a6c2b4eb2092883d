"""Test 2 of the paper: point sources beside extended ones."""

from __future__ import annotations

from collections.abc import Iterator

from survey_mc.paper.figures.classification import (
    Marked,
    Panel,
    classification_figure,
    extent_panels,
    found_of,
    statistic,
)
from survey_mc.paper.figures.images import first_field, smoothing_arcsec
from survey_mc.paper.figures.pairs import Member, ratio_figure
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import CHOSEN, detections, fields_phrase, procedure
from survey_mc.paper.figures.sheet import drawing
from survey_mc.paper.figures.test1 import pair_images
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_2, TEST_3

MEMBERS = (
    Member("fixed", "o", "○", "point sources fixed at 100 counts"),
    Member("varying", "s", "■", "extended sources"),
)
OTHERS = (("wavdetect", "PSFRATIO"), ("emldetect", "EXT_ML"), ("ewavelet", "EXTENT"))


def test2_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """Images, count ratios, and classification beside the point-only fields of Test 3."""
    with drawing():
        drawn = first_field(results, TEST_2)
        yield PaperFigure(
            "test2_images",
            "Test 2: points beside extended sources, four images",
            f"The paper's Fig. 4. One image (the first of {TEST_2}), as in Test 1 with β-model sources (core radius "
            f"30″, β = 0.75) in the right columns: photons with input counts, Gaussian of FWHM "
            f"{smoothing_arcsec(drawn):g}″, MR/1, and WAVDETECT's smoothed image with its detections. The counts and "
            "the core radius of the extended sources are not in the paper's text: they are ours.",
            pair_images(results, TEST_2, drawn),
        )
        yield PaperFigure(
            "test2_count_ratios",
            "Test 2: inferred over input counts",
            "The paper's Fig. 5, with the two procedures it leaves out. Squares: extended sources; circles: the points "
            "of 100 counts beside them; first image, a number beside an arrow where the ratio is above 2. Bars behind: "
            f"median and 68 % of {fields_phrase(results.n_fields(TEST_2), 'image')} of {TEST_2}, points on the left. "
            "Numbers: sources found in the first image, mean and standard deviation of their ratios, then the same for "
            "all images. Sources are identified within 20″, so a detection of a point may be given to the cluster.",
            ratio_figure(results, TEST_2, MEMBERS),
        )
        if results.has(TEST_3):
            yield from _classification(results)


def _classification(results: StudyResults) -> Iterator[PaperFigure]:
    words = (
        f"Grey: all detections in {fields_phrase(results.n_fields(TEST_3))} with point sources only ({TEST_3}), "
        f"thinned to 3000. Large symbols: extended sources (filled circles) and point sources (triangles) identified "
        f"in the first image of {TEST_2}; small ones: those of its other images, thinned to 600. Dashed: "
    )
    panels = _panels(results, ((CHOSEN, "r50_arcsec"), (CHOSEN, "stellarity")))
    if panels:
        yield PaperFigure(
            "test2_classification_mr1",
            "Test 2: extended or not, MR/1+SE",
            f"The paper's Fig. 6. Half-light radius and stellarity index (0 extended, 1 point) of MR/1+SE against "
            f"off-axis angle and detected counts. {words}the paper's cuts (R50 = 20″, stellarity 0.1). The stellarity "
            "index is our network, trained on simulated X-ray sources; the paper's was trained on optical images.",
            classification_figure(panels),
        )
    panels = _panels(results, OTHERS)
    if panels:
        yield PaperFigure(
            "test2_classification_others",
            "Test 2: extended or not, the other procedures",
            "The paper's Fig. 7 (WAVDETECT, ratio of the source's size to the PSF's) and, beyond the paper, the "
            "likelihood of the extent of EMLDETECT (0 where no extent was fitted; the axis is linear below 1) and the "
            f"fitted width of EWAVELET. {words}the cut of each statistic. EMLDETECT and EWAVELET split bright extended "
            "sources: what is shown is the piece identified with the source.",
            classification_figure(panels),
        )


def _panels(results: StudyResults, wanted: tuple[tuple[str, str], ...]) -> list[Panel]:
    panels = []
    for name, column in wanted:
        here, before = procedure(results, TEST_2, name), procedure(results, TEST_3, name)
        if here is None or before is None:
            continue
        marks = tuple(Marked(kind, found_of(results, TEST_2, here.label, kind)) for kind in ("point", "extended"))
        panels.append(Panel(here, statistic(name, column), detections(results, TEST_3, before.label), marks))
    return extent_panels(panels)
