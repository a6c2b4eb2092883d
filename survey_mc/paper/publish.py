"""From stored runs to what is published: tables of every base campaign, scorecard, figures, page, lock.

Idea     nothing here draws or detects; it can be repeated at any time and gives the same files. What depends on the
         machine (CPU seconds) is kept apart from what the lock promises.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from survey_mc.errors import BadInput
from survey_mc.paper.figures import study_figures, write_figure
from survey_mc.paper.page import study_page
from survey_mc.paper.results import StudyResults
from survey_mc.paper.scorecard import build_scorecard, write_scorecard
from survey_mc.report.tables import build_tables

PAGE = "index.html"
LOCK = "study.lock.json"
FIGURES = "figures"


def report_study(root: Path | str) -> Path:
    """Write tables, scorecard, figures, page and lock of a study from what it has stored; the path of the page."""
    results = StudyResults(root)
    if not results.campaigns:
        raise BadInput(str(results.root), "holds no run of the study; `survey-mc paper` makes them")
    for campaign in results.campaigns:
        if not campaign.is_option:
            data = results.run(campaign.name).data
            build_tables(data, data.layout.root)
    scorecard = build_scorecard(results)
    write_scorecard(scorecard, results.root)
    folder = results.root / FIGURES
    folder.mkdir(exist_ok=True)
    drawn = []
    for figure in study_figures(results):
        write_figure(figure, folder)
        drawn.append((figure.name, figure.title, figure.caption))
    _write(results.root / PAGE, study_page(results, scorecard.rows, drawn))
    _write(results.root / LOCK, json.dumps(_lock(results), indent=1, sort_keys=True) + "\n")
    return results.root / PAGE


def _lock(results: StudyResults) -> dict[str, Any]:
    """What was run, with which versions, and the SHA-256 of what came out of it; the same on every machine."""
    runs = {}
    for campaign in results.campaigns:
        lock = results.run(campaign.name).data.lock
        runs[campaign.name] = {
            "realisations": results.n_fields(campaign.name),
            "campaign_sha256": lock["campaign_sha256"],
            "versions": lock["versions"],
        }
    results_sha256 = {
        name: hashlib.sha256((results.root / name).read_bytes()).hexdigest()
        for name in ("scorecard.csv", "option_effects.csv")
    }
    return {"lock_schema": 1, "runs": runs, "results_sha256": results_sha256}


def _write(path: Path, text: str) -> None:
    """Whole or not at all."""
    temporary = path.with_name(f".{path.name}.tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)
