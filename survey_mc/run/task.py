"""The one function that is executed on a worker.

Idea     draw each field once, give only its observation to every method that still has work on it, match, and commit
         whole files. What goes back to the driver are crumbs: the results are already on disk.
Limits   an exception in one method on one field is a failure of that field and method alone; it is reported, never
         stored. So are a time-out and the death of a process: see `attempts` and `isolated`.
"""

from __future__ import annotations

import os
import socket
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from survey_mc.caches import forget_all
from survey_mc.campaign import Campaign, Cell, CellMethod, draw_field, expand
from survey_mc.campaign.lock import library_versions
from survey_mc.columns import Table
from survey_mc.errors import SurveyError
from survey_mc.run.order import Cause, Cost, Failure, Order, Outcome, Suspect
from survey_mc.run.quarantine.attempts import AttemptNote, FieldTimeout, Place, deaths
from survey_mc.run.quarantine.isolated import timeout_failure, timeout_text, try_alone
from survey_mc.run.quarantine.limits import COMPILATION_SECONDS, FieldLimits, limited_memory
from survey_mc.run.rows import Rows, StoredRows
from survey_mc.run.stages import detect_on, match_on, stored_truth
from survey_mc.store import Family, RunLayout
from survey_mc.types import Field, Skip

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.array_frame import ArrayFrame

T = TypeVar("T")
_TRACEBACK_CHARACTERS = 4000
KB_PER_MB = 1024.0  # ru_maxrss is in kilobytes on Linux
MAX_ATTEMPTS = 25  # processes that may die at an order; others may kill workers faster than they start
# A realisation that no campaign has: what is rehearsed on it is nobody's field.
REHEARSAL = 9_999_999


class _Attempt:
    """Runs stages with their place noted, their cost written down and their exceptions kept apart by field and method.

    note: where the place is noted; None where nobody looks for it.
    """

    def __init__(self, outcome: Outcome, note: AttemptNote | None = None, extra_s: float = 0.0) -> None:
        self.outcome, self.note, self.extra_s = outcome, note, extra_s

    @contextmanager
    def timed(self, method: str, stage: str, fields: int = 1) -> Iterator[None]:
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        cost = self.outcome.costs.setdefault((method, stage), Cost())
        cost.add(fields, time.process_time() - cpu, time.perf_counter() - wall)

    def __call__(self, place: Place, work: Callable[[], T]) -> T | None:
        """The result of `work`, or None after noting its exception."""
        if self.note is not None:
            self.note.at(place, self.extra_s)
        try:
            with self.timed(place.label, place.stage):
                return work()
        except FieldTimeout:
            self._fail(place, "timeout", timeout_text(self.note.limits if self.note else FieldLimits()))
        except BaseException as problem:
            if isinstance(problem, KeyboardInterrupt) and threading.current_thread() is threading.main_thread():
                raise
            cause: Cause = "memory" if isinstance(problem, MemoryError) else "exception"
            self._fail(place, cause, f"{type(problem).__name__}: {problem}")
        finally:
            if self.note is not None:
                self.note.rest()
        return None

    def _fail(self, place: Place, cause: Cause, text: str) -> None:
        trace = traceback.format_exc()[-_TRACEBACK_CHARACTERS:]
        self.outcome.failures.append(Failure(place.realisation, place.label, place.stage, cause, text[:500], trace))


_warm: set[tuple[str, ...]] = set()


def _warm_up(order: Order, cell: Cell, note: AttemptNote | None = None) -> None:
    """Rehearse on a field that is nobody's: compilation happens once a process and is not anyone's cost.

    Every second order rehearses its methods from the last to the first: two workers that start together then compile
    different procedures, and each reads from the cache what the other has compiled.
    """
    methods = tuple(m.name for m in cell.methods if m.label in order.detect)
    if methods not in _warm:
        _warm.add(methods)
        rehearsal = replace(order.only(REHEARSAL), match=order.detect)
        backwards = (order.start // order.n_fields + order.cell_index) % 2 == 1
        stage = replace(cell, methods=cell.methods[::-1]) if backwards else cell
        _work_on_field(rehearsal, stage, REHEARSAL, _Attempt(Outcome(), note, COMPILATION_SECONDS), Rows(), {})


_served: list[str] = []  # the campaign of the last order of this process


def _meet(campaign: Campaign) -> None:
    """Forget what was kept for another campaign."""
    if _served != [campaign.text]:
        _served[:] = [campaign.text]
        _warm.clear()
        forget_all()


_one_at_a_time = threading.Lock()


def run_task(order: Order) -> Outcome:
    """Do an order and commit its files; raises only for what is not the fault of a method (disk, store, versions).

    What killed the process of an earlier attempt at the order is tried in a process of its own.
    """
    _refuse_other_versions(order)
    # CPU time, memory limit and watchdog belong to a process, so a worker with several threads does one order at once.
    with _one_at_a_time, limited_memory(order.limits):
        _meet(order.campaign)
        cell = expand(order.campaign)[order.cell_index]
        folder, name = RunLayout(order.root).attempts, _name(order, cell)
        died = list(deaths(folder, name))
        if len(died) >= MAX_ATTEMPTS:
            raise RuntimeError(f"{len(died)} processes died at these fields, the last with: {died[-1].trace[:200]!r}")
        found = [Suspect(d.place.realisation, d.place.label, d.timed_out, d.trace) for d in died if d.place is not None]
        with AttemptNote(
            folder, name, order.limits, own_process=threading.current_thread() is threading.main_thread()
        ) as n:
            outcome = do_order(replace(order, suspects=(*order.suspects, *found)), n)
        for death in died:
            death.note.unlink(missing_ok=True)
    return outcome


def _name(order: Order, cell: Cell) -> str:
    return f"{cell.field_key}-{order.start:07d}-{order.stop:07d}"


def do_order(order: Order, note: AttemptNote | None) -> Outcome:
    """Draw, detect, match and commit the fields of an order in this process, its suspects in their own."""
    outcome = Outcome(host=socket.gethostname(), pid=os.getpid())
    attempt, rows = _Attempt(outcome, note), Rows()
    cell = expand(order.campaign)[order.cell_index]
    layout = RunLayout(order.root)
    stored = {label: StoredRows(layout, records) for label, records in order.stored.items()}
    suspects: dict[int, list[Suspect]] = {}
    for suspect in order.suspects:
        suspects.setdefault(suspect.realisation, []).append(suspect)
    if REHEARSAL not in suspects:
        _warm_up(order, cell, note)
    for realisation in range(order.start, order.stop):
        here = order
        if realisation in suspects:
            here = _judge(order, cell, realisation, suspects[realisation], outcome, note)
        _work_on_field(here, cell, realisation, attempt, rows, stored)
    if note is not None:
        note.at(None)
    outcome.records.extend(rows.commit(layout, attempt.timed))
    outcome.peak_mb = _peak_mb()
    return outcome


def _judge(
    order: Order, cell: Cell, realisation: int, suspects: list[Suspect], outcome: Outcome, note: AttemptNote | None
) -> Order:
    """What is left to do here of a field at which a process has died, after the suspects are dealt with."""
    left = order.only(realisation)
    for suspect in suspects:
        if suspect.timed_out:
            outcome.failures.append(timeout_failure(suspect, order.limits))
            left = left.without(suspect.label) if suspect.label else replace(left, truth=False, detect=(), match=())
    if all(suspect.timed_out for suspect in suspects):
        return left
    if note is not None:
        note.at(None)
    outcome.absorb(try_alone(left, cell.label))
    return replace(left, truth=False, detect=(), match=())


def _peak_mb() -> float:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KB_PER_MB


def _refuse_other_versions(order: Order) -> None:
    """Results are promised for one set of versions; a worker may have joined after the run began."""
    here = library_versions()
    for name, version in order.versions.items():
        if here.get(name) != version:
            raise SurveyError(
                f"the worker on {socket.gethostname()} has {name} {here.get(name)}, the run was started with "
                f"{version}; install the same versions on both"
            )


def measure_field(
    campaign: Campaign, cell: Cell, realisation: int, outcome: Outcome
) -> dict[Family, tuple[Table, str, ArrayFrame]]:
    """All stages of one field without storing anything: table, method label and rows of each family of files, with the
    costs added to `outcome`."""
    labels = tuple(m.label for m in cell.methods)
    order = Order(campaign, Path(), cell.index, realisation, realisation + 1, True, labels, labels)
    rows = Rows()
    _warm_up(order, cell)
    _work_on_field(order, cell, realisation, _Attempt(outcome), rows, {})
    return {
        family: (rows.tables[family], rows.methods[family], kept)
        for family, stored in rows.rows.items()
        for _, kept in stored
    }


def _work_on_field(
    order: Order, cell: Cell, realisation: int, attempt: _Attempt, rows: Rows, stored: Mapping[str, StoredRows]
) -> None:
    """Draw a field once and give it to every method that still has work on it."""
    methods = tuple(m for m in cell.methods if m.label in order.detect or m.label in order.match)
    if not (order.truth or methods):
        return
    drawn = attempt(
        Place(cell.field_key, realisation, "", "draw"), partial(draw_field, order.campaign, cell, realisation)
    )
    if drawn is None:
        return
    if order.truth:
        rows.keep("truth", cell.field_key, None, realisation, stored_truth(drawn))
    for method in methods:
        detections = _detections(order, method, drawn, realisation, attempt, rows, stored)
        if detections is not None and method.label in order.match:
            matched = attempt(
                Place(method.detect_key, realisation, method.label, "match"),
                partial(match_on, order.campaign, cell, drawn, detections),
            )
            if matched is not None:
                rows.keep("matches", method.match_key, method, realisation, matched.match_rows)
                rows.keep("links", method.match_key, method, realisation, matched.link_rows)


def _detections(
    order: Order,
    method: CellMethod,
    drawn: Field,
    realisation: int,
    attempt: _Attempt,
    rows: Rows,
    stored: Mapping[str, StoredRows],
) -> DataFrame | ArrayFrame | None:
    """What the method found on the field, now or in an earlier run; None if it failed or skipped the field."""
    if method.label not in order.detect:
        return stored[method.label].of(realisation)
    place = Place(method.detect_key, realisation, method.label, "detect")
    found = attempt(place, partial(detect_on, order.campaign, method, drawn, realisation))
    if found is None:
        return None
    if isinstance(found, Skip):
        attempt.outcome.skips.append((realisation, method.label, found.reason))
        return None
    rows.keep("detections", method.detect_key, method, realisation, found)
    return found
