"""The figures of the paper, drawn again from what a study has stored; matplotlib is imported with the first one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from survey_mc.paper.figures.contamination import contamination_figure
from survey_mc.paper.figures.cost import cost_figure
from survey_mc.paper.figures.headline import headline_figure
from survey_mc.paper.figures.instruments import instruments_figure
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.test1 import test1_figures
from survey_mc.paper.figures.test2 import test2_figures
from survey_mc.paper.figures.test3 import test3_figures
from survey_mc.paper.figures.test4 import test4_figures
from survey_mc.paper.figures.test5_completeness import completeness_figures
from survey_mc.paper.figures.test5_counts import counts_figures
from survey_mc.paper.figures.write import write_figure
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_1, TEST_2, TEST_3, TEST_4, TEST_5

__all__ = ["PaperFigure", "study_figures", "write_figure"]

_OF_CAMPAIGN: tuple[tuple[str, Callable[[StudyResults], Iterator[PaperFigure]]], ...] = (
    (TEST_1, test1_figures),
    (TEST_2, test2_figures),
    (TEST_3, test3_figures),
    (TEST_4, test4_figures),
    (TEST_5, completeness_figures),
    (TEST_5, counts_figures),
)


def study_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """The headline, then all figures in the paper's order; those of campaigns that were not run are left out."""
    if results.has(TEST_5):
        yield headline_figure(results)
    yield instruments_figure()
    for campaign, figures in _OF_CAMPAIGN:
        if results.has(campaign):
            yield from figures(results)
        if campaign == TEST_4 and results.has(TEST_4) and (curves := contamination_figure(results)) is not None:
            yield curves
    if results.has(TEST_5):
        yield cost_figure(results)
