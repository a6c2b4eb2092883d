"""What a run has, lacks, and why."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from survey_mc.store import CellRecord, RunData


@dataclass(frozen=True, slots=True)
class RunStatus:
    """rows: (cell, method, fields done, fields wanted). failures: journal entries of what is still missing because it
    failed, oldest first. skips: how often each reason was given in the last run."""

    root: Path
    rows: tuple[tuple[str, str, int, int], ...]
    failures: tuple[dict[str, Any], ...]
    skips: dict[str, int]

    @property
    def done(self) -> int:
        return sum(row[2] for row in self.rows)

    @property
    def wanted(self) -> int:
        return sum(row[3] for row in self.rows)

    @property
    def n_failed(self) -> int:
        return len(self.failures)

    def as_dict(self) -> dict[str, Any]:
        """The same for machines."""
        return {
            "run": str(self.root),
            "done": self.done,
            "wanted": self.wanted,
            "cells": [{"cell": c, "method": m, "done": d, "wanted": w} for c, m, d, w in self.rows],
            "failures": list(self.failures),
            "skips": self.skips,
        }


def run_status(run_dir: Path | str) -> RunStatus:
    """State of a run directory from its manifest and its journals."""
    data = RunData(run_dir)
    rows = tuple(
        (cell.label, label, data.realisations_done("matches", cell.label, label), cell.realisations)
        for cell in data.cells
        for label in data.cells[0].match_keys
    )
    stored = {
        (cell.label, label): data.manifest.records(cell.family("matches", label))
        for cell in data.cells
        for label in cell.match_keys
    }
    known = {cell.label: cell for cell in data.cells}
    latest: dict[tuple[str, str, int], dict[str, Any]] = {}
    skips: dict[str, int] = {}
    for entry in data.journal_lines():
        event = entry.get("event")
        if event == "start":
            skips = {}
        elif event == "skip":
            skips[entry["reason"]] = skips.get(entry["reason"], 0) + 1
        elif event in ("failure", "quarantine") and entry.get("cell") in known:
            for failure in _single_failures(entry, known[entry["cell"]]):
                latest[failure["cell"], failure["method"], failure["realisation"]] = failure
    missing = tuple(
        failure
        for (cell, method, realisation), failure in latest.items()
        if not any(r.piece.start <= realisation < r.piece.stop for r in stored.get((cell, method), ()))
    )
    return RunStatus(data.layout.root, rows, missing, skips)


def _single_failures(entry: dict[str, Any], cell: CellRecord) -> list[dict[str, Any]]:
    """Failures of single fields and methods: a quarantined task is one for each of its fields and methods.

    Those of another sky, instrument or other parameters than the campaign has now are left out.
    """
    shared = {
        "cell": entry["cell"],
        "cause": entry.get("cause", "exception"),
        "error": entry["error"],
        "replay": entry["replay"],
    }
    if entry["event"] == "failure":
        labels = [entry["method"]] if entry["method"] else list(cell.detect_keys)
        if entry["key"] != (cell.detect_keys.get(entry["method"]) if entry["method"] else cell.field_key):
            return []
        return [
            {**shared, "method": label, "realisation": entry["realisation"], "stage": entry["stage"]}
            for label in labels
        ]
    labels = [label for label, key in cell.detect_keys.items() if key in entry["keys"]]
    return [
        {**shared, "method": label, "realisation": realisation, "stage": "task"}
        for label in labels
        for realisation in range(entry["start"], entry["stop"])
    ]
