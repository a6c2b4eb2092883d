"""What a run would do and what it would cost, without doing it.

Idea     what is missing comes from the manifest; costs come from the journals of earlier runs of the same stage, else
         from one field of each cell, computed here and thrown away.
Limits   a calibration on one field is good to some ten per cent where the number of photons varies little between
         fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from survey_mc.campaign import Campaign, Cell, expand
from survey_mc.run.engine import default_run_dir, refuse_foreign
from survey_mc.run.gaps import known_gaps
from survey_mc.run.order import Order, Outcome
from survey_mc.run.pace import block_size
from survey_mc.run.stages import stack
from survey_mc.run.task import measure_field
from survey_mc.run.work import families_of, orders, shards
from survey_mc.store import Manifest, RunData, RunLayout
from survey_mc.store.parquet import encoded_bytes


@dataclass(frozen=True, slots=True)
class CellPlan:
    """One cell: fields the campaign asks for, fields with work left, and the CPU seconds and bytes of that work."""

    label: str
    fields: int
    to_do: int
    cpu_s: float
    size_bytes: int


@dataclass(frozen=True, slots=True)
class CampaignPlan:
    """A whole run. orders: tasks at the default block size. files: stored files when complete.

    measured: where the costs come from ("journal", "one field of each cell" or "nothing to do"). problems: what failed
    on the fields that were computed to measure, whose costs are then too low.
    """

    root: Path
    cells: tuple[CellPlan, ...]
    orders: int
    block: int
    files: int
    measured: str
    problems: tuple[str, ...]

    @property
    def cpu_s(self) -> float:
        return sum(cell.cpu_s for cell in self.cells)

    @property
    def size_bytes(self) -> int:
        return sum(cell.size_bytes for cell in self.cells)

    @property
    def to_do(self) -> int:
        return sum(cell.to_do for cell in self.cells)

    @property
    def fields(self) -> int:
        return sum(cell.fields for cell in self.cells)


def plan_campaign(campaign: Campaign, out: Path | str | None = None, workers: int = 1) -> CampaignPlan:
    """Tasks, fields done and to do, expected CPU time and bytes; nothing is written."""
    layout = RunLayout(Path(out).absolute() if out is not None else default_run_dir(campaign).absolute())
    refuse_foreign(campaign, layout)
    cells = expand(campaign)
    manifest = Manifest(layout.manifest)
    known = layout.lock_file.is_file()
    entries = list(RunData(layout.root).journal_lines()) if known else []
    per_file = campaign.store.realisations_per_file
    failed = known_gaps(entries).left_alone
    todo = [list(orders(campaign, (cell,), manifest, layout.root, per_file, failed)) for cell in cells]
    n_fields = sum(order.n_fields for mine in todo for order in mine)
    block = block_size(n_fields, workers, per_file)
    spent = _costs_of_journal(entries)
    measured = "journal" if spent else ("one field of each cell" if n_fields else "nothing to do")
    plans = []
    problems: list[str] = []
    for cell, mine in zip(cells, todo, strict=True):
        costs = {stage: spent[cell.label, *stage] for stage in _stages(mine) if (cell.label, *stage) in spent}
        size_bytes = 0
        if mine:
            sample, size_bytes = _measure(campaign, cell, problems)
            costs = {**sample, **costs}
        cpu_s = sum(costs.get(stage, 0.0) * order.n_fields for order in mine for stage in _stages([order]))
        n_mine = sum(order.n_fields for order in mine)
        plans.append(CellPlan(cell.label, cell.realisations, n_mine, cpu_s, size_bytes * n_mine))
    n_files = sum(1 for cell in cells for _ in shards(cell.realisations, per_file) for _ in families_of(cell))
    n_orders = sum(-(-order.n_fields // block) for mine in todo for order in mine)
    return CampaignPlan(layout.root, tuple(plans), n_orders, block, n_files, measured, tuple(problems))


def _stages(mine: list[Order]) -> list[tuple[str, str]]:
    found: dict[tuple[str, str], None] = {}
    for order in mine:
        found["", "draw"] = None
        for label in order.detect:
            found[label, "detect"] = None
        for label in order.match:
            found[label, "match"] = None
    return list(found)


def _costs_of_journal(entries: list[dict[str, object]]) -> dict[tuple[str, str, str], float]:
    """CPU seconds a field by (cell, method, stage), from all tasks that were journalled."""
    sums: dict[tuple[str, str, str], list[float]] = {}
    for entry in entries:
        if entry.get("event") != "task":
            continue
        for cost in entry["costs"]:  # type: ignore[attr-defined]
            total = sums.setdefault((str(entry["cell"]), cost["method"], cost["stage"]), [0.0, 0.0])
            total[0] += cost["cpu_s"]
            total[1] += cost["fields"]
    return {place: cpu / fields for place, (cpu, fields) in sums.items() if fields}


def _measure(campaign: Campaign, cell: Cell, problems: list[str]) -> tuple[dict[tuple[str, str], float], int]:
    """CPU seconds of each stage on the first field of a cell, and the bytes its rows take; notes what failed."""
    outcome = Outcome()
    rows = measure_field(campaign, cell, 0, outcome)
    problems.extend(f"{cell.label} / {f.method or 'drawing'}: {f.error}" for f in outcome.failures)
    size_bytes = sum(encoded_bytes(table, stack([(0, frame)], table)) for table, frame in rows)
    return {place: cost.cpu_s / max(cost.fields, 1) for place, cost in outcome.costs.items()}, size_bytes
