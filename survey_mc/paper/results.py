"""The study's runs opened for reading: frames by campaign, cell, method and rule, each read once.

Idea     figures and the scorecard ask for the same frames again and again; they are kept in memory, which a study of
         hundreds of fields allows (a million rows).
Limits   frames are shared: whoever changes one must copy it first.
"""

from __future__ import annotations

from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.errors import BadInput
from survey_mc.paper.study import StudyCampaign, study_campaigns
from survey_mc.run import Run, open_run
from survey_mc.store import Manifest, RunLayout
from survey_mc.store.layout import StoredTable

if TYPE_CHECKING:
    from pandas import DataFrame


class StudyResults:
    """What `survey-mc paper` has stored below its folder, one run directory for each campaign."""

    def __init__(self, root: Path | str) -> None:
        self.root = Path(root)
        self._open = cache(self._open_run)
        self._matches = cache(self._read_matches)
        self._detections = cache(self._read_detections)
        self._truth = cache(self._read_truth)

    @cached_property
    def campaigns(self) -> tuple[StudyCampaign, ...]:
        """The campaigns of the study of which something is stored; a lock file alone may be a published one."""
        return tuple(c for c in study_campaigns() if self._is_stored(self.root / c.name))

    def has(self, campaign: str) -> bool:
        """Whether a campaign was run."""
        return any(c.name == campaign for c in self.campaigns)

    def run(self, campaign: str) -> Run:
        """A campaign's run; `BadInput` if it was not run."""
        return self._open(campaign)

    def n_fields(self, campaign: str) -> int:
        """Realisations of each cell."""
        return self.run(campaign).data.cells[0].realisations

    def n_lacking(self, campaign: str, method: str, cell: str) -> int:
        """Realisations of a cell that a method (by label) has not been through: failed, skipped or not yet run."""
        data = self.run(campaign).data
        tables: tuple[StoredTable, ...] = ("detections", "matches", "links")
        return data.cell(cell).realisations - min(data.realisations_done(table, cell, method) for table in tables)

    def matches(self, campaign: str, method: str, rule: str = "nearest", cell: str | None = None) -> DataFrame:
        """Matches of a method (by label) and rule; cell: label such as "xmm_epic_soft_10ks", default the first."""
        return self._matches(campaign, method, rule, cell or self.run(campaign).cells[0])

    def detections(self, campaign: str, method: str, cell: str | None = None) -> DataFrame:
        """Detections of a method (by label), its own columns included."""
        return self._detections(campaign, method, cell or self.run(campaign).cells[0])

    def links(self, campaign: str, method: str, cell: str | None = None) -> DataFrame:
        """Candidate pairs of a method."""
        return self.run(campaign).links(method, cell or self.run(campaign).cells[0])

    def truth(self, campaign: str, cell: str | None = None) -> DataFrame:
        """True sources of all fields."""
        return self._truth(campaign, cell or self.run(campaign).cells[0])

    @staticmethod
    def _is_stored(run_dir: Path) -> bool:
        layout = RunLayout(run_dir)
        return layout.lock_file.is_file() and len(Manifest(layout.manifest)) > 0

    def _open_run(self, campaign: str) -> Run:
        if not self.has(campaign):
            raise BadInput(str(self.root), f"has no run of {campaign}; `survey-mc paper` makes it")
        return open_run(self.root / campaign)

    def _read_matches(self, campaign: str, method: str, rule: str, cell: str) -> DataFrame:
        return self.run(campaign).matches(method, cell, rule)

    def _read_detections(self, campaign: str, method: str, cell: str) -> DataFrame:
        return self.run(campaign).detections(method, cell)

    def _read_truth(self, campaign: str, cell: str) -> DataFrame:
        return self.run(campaign).truth(cell)
