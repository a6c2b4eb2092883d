"""Taking in what the workers have done: manifest, journal, whole files, and word of the progress."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from survey_mc.campaign import Campaign, Cell
from survey_mc.errors import SurveyError
from survey_mc.run.executors import Executor
from survey_mc.run.gaps import Gaps
from survey_mc.run.journal import Journal
from survey_mc.run.order import Order, Outcome
from survey_mc.run.pack import pack_shard
from survey_mc.run.plan.pace import Pace
from survey_mc.run.work import families_of
from survey_mc.store import Manifest, RunLayout

WHOLE_ORDER = "(whole task)"
DRAWING = "(drawing)"


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a run: fields done and to do in it, failures so far by method label, workers there now.

    dashboard: address of dask's dashboard, if it is on.
    """

    done: int
    total: int
    failures: dict[str, int]
    workers: int = 1
    dashboard: str | None = None


class Harvest:
    """Enters finished orders into the manifest, the journal and the gaps. causes: failures of this run by cause."""

    def __init__(
        self,
        campaign: Campaign,
        cells: tuple[Cell, ...],
        layout: RunLayout,
        manifest: Manifest,
        journal: Journal,
        gaps: Gaps,
        pace: Pace,
    ) -> None:
        self.cells, self.layout, self.manifest, self.journal = cells, layout, manifest, journal
        self.gaps, self.pace = gaps, pace
        self.per_file = campaign.store.realisations_per_file
        self.causes: dict[str, int] = {}
        self.failures: dict[str, int] = {}

    def gather(
        self, executor: Executor, orders: Iterable[Order], n_fields: int, on_progress: Callable[[Progress], None]
    ) -> None:
        """Have all orders done. Raises what is nobody's fault but stops every order (disk, store, versions)."""
        done = 0

        def tell() -> None:
            state = Progress(done, n_fields, dict(self.failures), executor.workers_now(), executor.dashboard)
            on_progress(state)

        tell()
        for finished in executor.execute(orders):
            if finished is not None:
                order, result = finished
                self._take(order, result)
                done += order.n_fields
            tell()

    def _take(self, order: Order, result: Outcome | Exception) -> None:
        cell = self.cells[order.cell_index]
        if isinstance(result, Exception):
            if isinstance(result, OSError | SurveyError):
                raise result
            self._quarantine(order, cell, f"{type(result).__name__}: {result}")
            return
        keys = {"": cell.field_key} | {m.label: m.detect_key for m in cell.methods}
        self.manifest.add(result.records)
        self.journal.task(cell.label, order, result, keys, str(self.layout.root))
        for realisation, method, _ in result.skips:
            self.gaps.skip(keys[method], realisation)
        for failure in result.failures:
            self.gaps.fail(keys[failure.method], (failure.realisation,))
            self._count(failure.method or DRAWING, failure.cause, 1)
        self.pace.book(cell.index, order.n_fields, result)
        start = order.start // self.per_file * self.per_file
        shard = (start, min(start + self.per_file, cell.realisations))
        for family in families_of(cell):
            pack_shard(self.layout, self.manifest, family, shard, only_whole=True)

    def _quarantine(self, order: Order, cell: Cell, error: str) -> None:
        """Give up an order that takes down whatever process it is given to, at no field in particular."""
        wanted = {m.label: m.detect_key for m in cell.methods if m.label in {*order.detect, *order.match}}
        keys = wanted | ({"": cell.field_key} if order.truth else {})
        self.journal.quarantine(cell.label, order, keys, error, str(self.layout.root))
        for key in keys.values():
            self.gaps.fail(key, range(order.start, order.stop))
        self._count(WHOLE_ORDER, "crash", order.n_fields)

    def _count(self, name: str, cause: str, number: int) -> None:
        self.failures[name] = self.failures.get(name, 0) + number
        self.causes[cause] = self.causes.get(cause, 0) + number
