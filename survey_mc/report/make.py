"""The report of a run directory, with one of its fields drawn again to be looked at."""

from __future__ import annotations

from pathlib import Path

from survey_mc.campaign import load_run_campaign
from survey_mc.errors import BadInput
from survey_mc.report.build import build_report
from survey_mc.report.field_process import one_field_figures
from survey_mc.report.tables import build_tables
from survey_mc.store import RunData
from survey_mc.store.digest_list import read_digests


def make_report(run_dir: Path | str) -> Path:
    """Write tables, figures and report/index.html of a run from what it has stored; the path of the page."""
    data = RunData(run_dir)
    if not data.layout.manifest.is_file():
        raise BadInput(
            str(data.layout.root),
            "has nothing stored (a published run keeps its tables and lock only); `survey-mc run` with its campaign "
            "file makes it again",
        )
    campaign = load_run_campaign(data.layout.root)
    return build_report(data, data.layout.root, one_field_figures(data, campaign), campaign.text)


def remake_report(run_dir: Path | str) -> None:
    """Make again what a run directory has of a report: the tables alone where there is no page, as in a study."""
    data = RunData(run_dir)
    listed = read_digests(data.layout) or {}
    if data.layout.report.exists() or any(name.startswith("report/") for name in listed):
        make_report(run_dir)
    else:
        build_tables(data, data.layout.root)
