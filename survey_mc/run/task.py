"""The one function that is executed on a worker.

Idea     draw each field once, give only its observation to every method that still has work on it, match, and commit
         whole files. What goes back to the driver are crumbs: the results are already on disk.
Limits   an exception in one method on one field is a failure of that field and method alone; it is reported, never
         stored.
"""

from __future__ import annotations

import os
import resource
import socket
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from survey_mc.campaign import Campaign, Cell, CellMethod, draw_field, expand
from survey_mc.columns import Table
from survey_mc.run.stages import detect_on, match_on, stack, stored_truth, table_of
from survey_mc.store import Family, Piece, Record, RunLayout, commit_piece, read_piece
from survey_mc.store.layout import StoredTable
from survey_mc.types import Field, Skip

if TYPE_CHECKING:
    from pandas import DataFrame

T = TypeVar("T")
_TRACEBACK_CHARACTERS = 4000
KB_PER_MB = 1024.0  # ru_maxrss is in kilobytes on Linux


@dataclass(frozen=True, slots=True)
class Order:
    """Work on realisations start … stop − 1 of a cell.

    truth: whether their truth is still to be stored. detect, match: labels of the methods that still have to run, or
    only to be matched. stored: files with the detections of the methods that only have to be matched.
    """

    campaign: Campaign
    root: Path
    cell_index: int
    start: int
    stop: int
    truth: bool
    detect: tuple[str, ...]
    match: tuple[str, ...]
    stored: dict[str, tuple[Record, ...]] = field(default_factory=dict)

    @property
    def n_fields(self) -> int:
        return self.stop - self.start


@dataclass(frozen=True, slots=True)
class Failure:
    """An exception of one stage on one field; method is empty when the field could not be drawn."""

    realisation: int
    method: str
    stage: str
    error: str
    trace: str


@dataclass(slots=True)
class Cost:
    """Seconds spent in a stage, summed over fields."""

    fields: int = 0
    cpu_s: float = 0.0
    wall_s: float = 0.0


@dataclass(slots=True)
class Outcome:
    """Crumbs of a finished order: what was committed, what failed, what was skipped, what it cost."""

    records: list[Record] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    skips: list[tuple[int, str, str]] = field(default_factory=list)
    costs: dict[tuple[str, str], Cost] = field(default_factory=dict)
    peak_mb: float = 0.0
    host: str = ""
    pid: int = 0


class _Attempt:
    """Runs stages with their cost written down and their exceptions kept apart by field and method."""

    def __init__(self, outcome: Outcome) -> None:
        self.outcome = outcome

    @contextmanager
    def timed(self, method: str, stage: str, fields: int = 1) -> Iterator[None]:
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        cost = self.outcome.costs.setdefault((method, stage), Cost())
        cost.fields += fields
        cost.cpu_s += time.process_time() - cpu
        cost.wall_s += time.perf_counter() - wall

    def __call__(self, realisation: int, method: str, stage: str, work: Callable[[], T]) -> T | None:
        """The result of `work`, or None after noting its exception."""
        try:
            with self.timed(method, stage):
                return work()
        except (Exception, SystemExit) as problem:
            text = f"{type(problem).__name__}: {problem}"
            trace = traceback.format_exc()[-_TRACEBACK_CHARACTERS:]
            self.outcome.failures.append(Failure(realisation, method, stage, text[:500], trace))
            return None


class _Harvest:
    """Rows that are ready to be stored, by family, in order of realisation."""

    def __init__(self) -> None:
        self.rows: dict[Family, list[tuple[int, DataFrame]]] = {}
        self.tables: dict[Family, Table] = {}
        self.methods: dict[Family, str] = {}

    def keep(self, name: StoredTable, key: str, method: CellMethod | None, realisation: int, frame: DataFrame) -> None:
        family = Family(name, key)
        if family not in self.rows:
            self.rows[family] = []
            self.tables[family] = table_of(name, method.name if method else "")
            self.methods[family] = method.label if method else ""
        self.rows[family].append((realisation, frame))

    def commit(self, layout: RunLayout, attempt: _Attempt) -> Iterator[Record]:
        for family, rows in self.rows.items():
            table = self.tables[family]
            for run in _contiguous(rows):
                with attempt.timed(self.methods[family], "commit", len(run)):
                    yield commit_piece(layout, Piece(family, run[0][0], run[-1][0] + 1), table, stack(run, table))


_warm: set[tuple[str, ...]] = set()


def _warm_up(order: Order, cell: Cell) -> None:
    """Do the first field once without booking it: compilation happens once a process and is not anyone's cost.

    Every second order rehearses its methods from the last to the first: two workers that start together then compile
    different procedures, and each reads from the cache what the other has compiled.
    """
    methods = tuple(m.name for m in cell.methods if m.label in order.detect)
    if methods not in _warm:
        _warm.add(methods)
        rehearsal = replace(order, stop=order.start + 1, match=order.detect)
        backwards = (order.start // order.n_fields + order.cell_index) % 2 == 1
        stage = replace(cell, methods=cell.methods[::-1]) if backwards else cell
        _work_on_field(rehearsal, stage, order.start, _Attempt(Outcome()), _Harvest(), {})


def run_task(order: Order) -> Outcome:
    """Do an order and commit its files; raises only for what is not the fault of a method (disk, store, keys)."""
    outcome = Outcome(host=socket.gethostname(), pid=os.getpid())
    attempt, harvest = _Attempt(outcome), _Harvest()
    cell = expand(order.campaign)[order.cell_index]
    layout = RunLayout(order.root)
    stored = {label: _Stored(layout, records) for label, records in order.stored.items()}
    _warm_up(order, cell)
    for realisation in range(order.start, order.stop):
        _work_on_field(order, cell, realisation, attempt, harvest, stored)
    outcome.records.extend(harvest.commit(layout, attempt))
    outcome.peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KB_PER_MB
    return outcome


def measure_field(campaign: Campaign, cell: Cell, realisation: int, outcome: Outcome) -> list[tuple[Table, DataFrame]]:
    """All stages of one field without storing anything: its tables, with the costs added to `outcome`."""
    labels = tuple(m.label for m in cell.methods)
    order = Order(campaign, Path(), cell.index, realisation, realisation + 1, True, labels, labels)
    harvest = _Harvest()
    _warm_up(order, cell)
    _work_on_field(order, cell, realisation, _Attempt(outcome), harvest, {})
    return [(harvest.tables[family], frame) for family, rows in harvest.rows.items() for _, frame in rows]


def _work_on_field(
    order: Order, cell: Cell, realisation: int, attempt: _Attempt, harvest: _Harvest, stored: Mapping[str, _Stored]
) -> None:
    """Draw a field once and give it to every method that still has work on it."""
    drawn = attempt(realisation, "", "draw", partial(draw_field, order.campaign, cell, realisation))
    if drawn is None:
        return
    methods = tuple(m for m in cell.methods if m.label in order.detect or m.label in order.match)
    if order.truth:
        harvest.keep("truth", cell.field_key, None, realisation, stored_truth(drawn))
    for method in methods:
        detections = _detections(order, method, drawn, realisation, attempt, harvest, stored)
        if detections is not None and method.label in order.match:
            matched = attempt(
                realisation, method.label, "match", partial(match_on, order.campaign, cell, drawn, detections)
            )
            if matched is not None:
                harvest.keep("matches", method.match_key, method, realisation, matched.matches)
                harvest.keep("links", method.match_key, method, realisation, matched.links)


def _detections(
    order: Order,
    method: CellMethod,
    drawn: Field,
    realisation: int,
    attempt: _Attempt,
    harvest: _Harvest,
    stored: Mapping[str, _Stored],
) -> DataFrame | None:
    """What the method found on the field, now or in an earlier run; None if it failed or skipped the field."""
    if method.label not in order.detect:
        return stored[method.label].of(realisation)
    work = partial(detect_on, order.campaign, method, drawn, realisation)
    found = attempt(realisation, method.label, "detect", work)
    if found is None:
        return None
    if isinstance(found, Skip):
        attempt.outcome.skips.append((realisation, method.label, found.reason))
        return None
    harvest.keep("detections", method.detect_key, method, realisation, found)
    return found


class _Stored:
    """Detections that are already in the store, by realisation."""

    def __init__(self, layout: RunLayout, records: tuple[Record, ...]) -> None:
        self.layout, self.records = layout, records
        self.frames: dict[Piece, DataFrame] = {}

    def of(self, realisation: int) -> DataFrame:
        record = next(r for r in self.records if r.piece.start <= realisation < r.piece.stop)
        if record.piece not in self.frames:
            self.frames[record.piece] = read_piece(self.layout, record)
        frame = self.frames[record.piece]
        return frame[frame["realisation"] == realisation].drop(columns="realisation").reset_index(drop=True)


def _contiguous(rows: list[tuple[int, DataFrame]]) -> Iterator[list[tuple[int, DataFrame]]]:
    """Runs of consecutive realisations: a failed field leaves a gap between two files."""
    run: list[tuple[int, DataFrame]] = []
    for row in rows:
        if run and row[0] != run[-1][0] + 1:
            yield run
            run = []
        run.append(row)
    if run:
        yield run
