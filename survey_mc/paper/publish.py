"""From stored runs to what is published: tables of every base campaign, scorecard, figures, page, lock.

Idea     nothing here draws or detects; it can be repeated at any time and gives the same files. What depends on the
         machine (CPU seconds) is kept apart from what the lock promises.
"""

from __future__ import annotations

from pathlib import Path

from survey_mc.errors import BadInput
from survey_mc.fits.writing import write_whole
from survey_mc.paper.figures import study_figures, write_figure
from survey_mc.paper.page import study_page
from survey_mc.paper.reproduce import FIGURES, LOCK, PAGE
from survey_mc.paper.results import StudyResults
from survey_mc.paper.scorecard import build_scorecard, write_scorecard
from survey_mc.paper.study_lock import write_study_lock
from survey_mc.report.tables import build_tables


def report_study(root: Path | str) -> Path:
    """Write tables, scorecard, figures, page and lock of a study from what it has stored; the path of the page."""
    results = StudyResults(root)
    if not results.campaigns:
        raise BadInput(str(results.root), "holds no run of the study; `survey-mc paper` makes them")
    for campaign in results.campaigns:
        if not campaign.is_option:
            data = results.run(campaign.name).data
            build_tables(data, data.layout.root)
    scorecard = build_scorecard(StudyResults(root))  # its frames, a gigabyte of a large study, go before the figures
    write_scorecard(scorecard, results.root)
    folder = results.root / FIGURES
    folder.mkdir(exist_ok=True)
    drawn = []
    for figure in study_figures(results):
        write_figure(figure, folder)
        drawn.append((figure.name, figure.title, figure.caption))
    page = study_page(results, scorecard.rows, drawn)
    write_whole(results.root / PAGE, page.encode(), overwrite=True)
    write_study_lock(results, results.root / LOCK)
    return results.root / PAGE
