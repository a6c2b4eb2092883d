"""What the stages of a field cost: from journals, or measured on a few fields that are thrown away.

Idea     seconds a field by method and stage. A file costs something by itself and something a row, in bytes and in
         seconds; both are read from the rows of the sample and from half of them, encoded in memory.
Limits   the first field of a process is done once more without being booked, so compilation is nobody's cost.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from survey_mc.campaign import Campaign, Cell, draw_field
from survey_mc.columns import Table
from survey_mc.run.order import Cost, Outcome
from survey_mc.run.stages import stack
from survey_mc.run.task import measure_field
from survey_mc.store import Family
from survey_mc.store.parquet import encoded_bytes

SAMPLE_FIELDS = 5
SAMPLE_SECONDS = 1.0
# Reading back, hashing and renaming a file beside encoding it: measured 1.5 to 2.5.
WRITING_PER_ENCODING = 2.3
# A worker spends some on its scheduler, and shares caches with its neighbours: measured 1.05 to 1.3.
WORKER_PER_SAMPLE = 1.1

Stage = tuple[str, str]  # method label (empty: drawing, truth) and draw, detect, match or commit


@dataclass(slots=True)
class JournalCosts:
    """Costs by cell and stage, summed over the tasks of journals; a commit counts for each field and file of it."""

    sums: dict[str, defaultdict[Stage, Cost]] = field(default_factory=dict)

    def noted(self, entries: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        """The same entries, their costs being added while they pass: a journal need not be held in memory."""
        for entry in entries:
            if entry.get("event") == "task":
                mine = self.sums.setdefault(str(entry["cell"]), defaultdict(Cost))
                for cost in entry["costs"]:
                    mine[cost["method"], cost["stage"]].add(cost["fields"], cost["cpu_s"], cost["wall_s"])
            yield entry

    def of(self, cell: Cell) -> dict[Stage, float]:
        """CPU seconds a field by stage, as far as they are known."""
        mine: Mapping[Stage, Cost] = self.sums.get(cell.label, {})
        return {stage: cost.cpu_s / cost.fields for stage, cost in mine.items() if cost.fields}


@dataclass(frozen=True, slots=True)
class FileCost:
    """Bytes and CPU seconds of writing a file: of one by itself, and of each field in it. label: of the method."""

    label: str
    file_bytes: float
    field_bytes: float
    file_s: float
    field_s: float


@dataclass(frozen=True, slots=True)
class Sample:
    """A few fields of a cell: CPU seconds a field by stage, and what their files cost. problems: what failed."""

    stages: dict[Stage, float]
    files: dict[Family, FileCost]
    problems: tuple[str, ...]

    def commits(self, block: int) -> dict[Stage, float]:
        """CPU seconds a field and file's table to write files of `block` fields."""
        each: defaultdict[str, list[float]] = defaultdict(list)
        for cost in self.files.values():
            each[cost.label].append(cost.file_s / block + cost.field_s)
        return {(label, "commit"): sum(costs) / len(costs) for label, costs in each.items()}


def sample(campaign: Campaign, cell: Cell, labels: Iterable[str]) -> Sample:
    """Do a few fields of a cell with some of its methods, about a second's work, and store nothing."""
    chosen = set(labels)
    cell = replace(cell, methods=tuple(method for method in cell.methods if method.label in chosen))
    outcome = Outcome()
    rows: defaultdict[Family, list[tuple[int, Any]]] = defaultdict(list)
    tables: dict[Family, tuple[Table, str]] = {}
    draw_field(campaign, cell, 0)  # builds what all fields of the cell share
    begun = time.process_time()
    for n in range(SAMPLE_FIELDS):
        for family, (table, label, frame) in measure_field(campaign, cell, n, outcome).items():
            rows[family].append((n, frame))
            tables[family] = table, label
        if time.process_time() - begun > SAMPLE_SECONDS:
            break
    problems = sorted({f"{cell.label} / {f.method or 'drawing'}: {f.error}" for f in outcome.failures})
    stages = {stage: WORKER_PER_SAMPLE * cost.cpu_s / max(cost.fields, 1) for stage, cost in outcome.costs.items()}
    files = {family: _file_cost(*tables[family], parts) for family, parts in rows.items()}
    return Sample(stages, files, tuple(problems))


def _file_cost(table: Table, label: str, parts: list[tuple[int, Any]]) -> FileCost:
    """The costs as a straight line through all rows and the first half of them."""
    frame = stack(parts, table).frame()
    half = frame.iloc[: len(frame) // 2]
    _encoded(table, half)  # the first call loads what it needs
    half_bytes, half_s = _encoded(table, half)
    all_bytes, all_s = _encoded(table, frame)
    n_rows = max(len(frame) - len(half), 1)
    row_bytes, row_s = max(0.0, all_bytes - half_bytes) / n_rows, max(0.0, all_s - half_s) / n_rows
    rows_in_field = len(frame) / len(parts)
    return FileCost(
        label,
        all_bytes - row_bytes * len(frame),
        row_bytes * rows_in_field,
        max(0.0, all_s - row_s * len(frame)),
        row_s * rows_in_field,
    )


def _encoded(table: Table, frame: Any) -> tuple[float, float]:
    """Bytes and CPU seconds of writing a file with these rows."""
    begun = time.process_time()
    size = encoded_bytes(table, frame)
    return float(size), WRITING_PER_ENCODING * (time.process_time() - begun)
