"""Run the whole study: every campaign on one set of workers, then tables, scorecard, figures and page.

Idea     each campaign has its own run directory below the study's folder, with lock, manifest and journal like any
         other; started again, the study does what is missing.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from survey_mc.campaign import Campaign, expand, load_resized
from survey_mc.errors import BadInput
from survey_mc.paper.study import StudyCampaign, StudySize, study_campaigns
from survey_mc.run import FieldLimits, Progress, RunSummary, run_campaign
from survey_mc.run.executors import ExecutorChoice, open_executor
from survey_mc.store import RunLayout

DEFAULT_OUT = Path("results") / "valtchanov2001"
DEFAULT_CAMPAIGNS = Path("campaigns")
PAGE, LOCK, FIGURES = "index.html", "study.lock.json", "figures"
PUBLISHED = (PAGE, LOCK, FIGURES, "scorecard.csv")  # what is made of the runs, beside their directories

ShowProgress = Callable[[str], AbstractContextManager[Callable[[Progress], None]]]


@dataclass(frozen=True, slots=True)
class StudySummary:
    """What a study did: the runs by campaign name."""

    root: Path
    runs: dict[str, RunSummary]

    @property
    def fields(self) -> int:
        return sum(run.fields for run in self.runs.values())

    @property
    def complete(self) -> bool:
        return all(run.complete for run in self.runs.values())


def run_study(
    size: StudySize,
    out: Path = DEFAULT_OUT,
    campaigns: Path = DEFAULT_CAMPAIGNS,
    executor: ExecutorChoice | None = None,
    *,
    limits: FieldLimits | None = None,
    with_options: bool | None = None,
    show_progress: ShowProgress | None = None,
) -> StudySummary:
    """Simulate, detect and match all that is missing in the study.

    out: folder of the study; each campaign's run directory is `out/<name>`. campaigns: folder of the campaign files.
    with_options: run the option campaigns; default whether the study is large enough for verdicts that need them.
    Raises `BadInput` before anything is done if a campaign file is missing or wrong.
    """
    chosen = tuple(study_campaigns(size.decides if with_options is None else with_options))
    loaded = {c.name: _loaded(c, campaigns, size) for c in chosen}
    # The one with most fields first: a single field would be drawn, and all procedures compiled for it, by one worker.
    order = sorted(chosen, key=lambda c: (c.is_option, -_n_fields(loaded[c.name])))
    _refuse_foreign(out)
    runs: dict[str, RunSummary] = {}
    with open_executor(executor or ExecutorChoice()) as opened:
        for place, study in enumerate(order, start=1):
            title = f"{study.name} ({place} of {len(chosen)})"
            with (show_progress or _silent)(title) as on_progress:
                runs[study.name] = run_campaign(
                    loaded[study.name], out / study.name, opened, limits=limits, on_progress=on_progress
                )
    return StudySummary(out, runs)


def _n_fields(campaign: Campaign) -> int:
    return len(expand(campaign)) * campaign.grid.realisations


def _loaded(study: StudyCampaign, campaigns: Path, size: StudySize) -> Campaign:
    path = study.file(campaigns)
    if not path.is_file():
        raise BadInput(
            str(path), "there is no such campaign file; run this where the `campaigns` folder is, or give --campaigns"
        )
    campaign = load_resized(path, size.fields(study))
    if campaign.name != study.name:
        raise BadInput(str(path), f"name: must be {study.name!r}, the campaign of the study (got {campaign.name!r})")
    return campaign


def _refuse_foreign(out: Path) -> None:
    """Raise `BadInput` for a folder that is no study's and holds what a study would overwrite."""
    if RunLayout(out).lock_file.is_file():
        raise BadInput(str(out), "is the run directory of one campaign; give another --out")
    if any(RunLayout(out / study.name).lock_file.is_file() for study in study_campaigns()):
        return
    taken = [name for name in PUBLISHED if (out / name).exists()]
    if taken:
        raise BadInput(str(out), f"is no folder of a study and has a {taken[0]} already; give another --out")


def _silent(title: str) -> AbstractContextManager[Callable[[Progress], None]]:
    return nullcontext(lambda state: None)
