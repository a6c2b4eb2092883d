"""What a run has, lacks, and why; and how it gets on."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from survey_mc.run.order import Cost
from survey_mc.run.status.digest import LatestStart, Place, digest
from survey_mc.run.status.holder import Holder, holder
from survey_mc.store import RunData


@dataclass(frozen=True, slots=True)
class LastRun:
    """The latest start of a run. fields, done: what it set out to do and did. begun_at, latest_at: ISO 8601, of its
    start and of its latest entry in the journal; empty before the first start.

    at_work: who writes to the run directory now, in words; empty if nobody does. is_over: it came to its end; one that
    was killed did not. fields_per_s: None before anything is done. left_s: seconds to the end at that rate; None if
    nobody is at work.
    """

    at_work: str = ""
    begun_at: str = ""
    latest_at: str = ""
    executor: str = ""
    workers: int = 0
    fields: int = 0
    done: int = 0
    is_over: bool = False
    fields_per_s: float | None = None
    left_s: float | None = None


@dataclass(frozen=True, slots=True)
class RunStatus:
    """rows: (cell, method, fields done, fields wanted). failures: journal entries of what is still missing because it
    failed, oldest first; skips: how many fields are missing for each reason that a method gave. costs: what was spent
    so far, by method label (empty: drawing) and stage."""

    root: Path
    rows: tuple[tuple[str, str, int, int], ...]
    failures: tuple[dict[str, Any], ...]
    skips: dict[str, int]
    costs: dict[tuple[str, str], Cost]
    last_run: LastRun

    @property
    def done(self) -> int:
        return sum(row[2] for row in self.rows)

    @property
    def wanted(self) -> int:
        return sum(row[3] for row in self.rows)

    @property
    def n_failed(self) -> int:
        return len(self.failures)

    @property
    def first_failures(self) -> tuple[dict[str, Any], ...]:
        """The oldest failure of each method, and in `n` how many it has."""
        firsts: dict[str, dict[str, Any]] = {}
        for failure in self.failures:
            firsts.setdefault(failure["method"], {**failure, "n": 0})["n"] += 1
        return tuple(firsts.values())

    @property
    def cpu_s(self) -> dict[str, float]:
        """CPU seconds so far by method label; empty: drawing, and storing the truth."""
        sums: dict[str, float] = {}
        for (method, _), cost in self.costs.items():
            sums[method] = sums.get(method, 0.0) + cost.cpu_s
        return sums

    def as_dict(self) -> dict[str, Any]:
        """The same for machines."""
        return {
            "run": str(self.root),
            "done": self.done,
            "wanted": self.wanted,
            "cells": [{"cell": c, "method": m, "done": d, "wanted": w} for c, m, d, w in self.rows],
            "failures": list(self.failures),
            "first_failures": list(self.first_failures),
            "skips": self.skips,
            "cpu_s": self.cpu_s,
            "costs": [{"method": m, "stage": s, **asdict(cost)} for (m, s), cost in self.costs.items()],
            "last_run": asdict(self.last_run),
        }


def run_status(run_dir: Path | str) -> RunStatus:
    """State of a run directory from its manifest and its journals."""
    data = RunData(run_dir)
    rows = tuple(
        (cell.label, label, data.realisations_done("matches", cell.label, label), cell.realisations)
        for cell in data.cells
        for label in cell.match_keys
    )
    told = digest(data.journal_lines(), data.cells)
    missing = [gap for place, gap in told.open.items() if _is_missing(data, place)]
    failures = tuple(gap for gap in missing if "error" in gap)
    skips: dict[str, int] = {}
    for gap in missing:
        if "reason" in gap:
            skips[gap["reason"]] = skips.get(gap["reason"], 0) + 1
    return RunStatus(data.layout.root, rows, failures, skips, told.costs, _last_run(told.latest, holder(data.layout)))


def _last_run(latest: LatestStart | None, held_by: Holder | None) -> LastRun:
    at_work = "" if held_by is None else held_by.phrase
    if latest is None:
        return LastRun(at_work)
    return LastRun(
        at_work,
        latest.begun_at,
        latest.latest_at,
        latest.executor,
        latest.workers,
        latest.fields,
        latest.done,
        latest.is_over,
        latest.fields_per_s,
        # what holds the directory after the end packs its files, or has not begun to write its journal
        latest.left_s(datetime.now(UTC)) if at_work and not latest.is_over else None,
    )


def _is_missing(data: RunData, place: Place) -> bool:
    """Whether the campaign asks for a field and method that is not stored."""
    label, method, realisation = place
    cell = data.cell(label)
    is_stored = data.manifest.covering(cell.family("matches", method), realisation, realisation + 1)
    return realisation < cell.realisations and not is_stored
