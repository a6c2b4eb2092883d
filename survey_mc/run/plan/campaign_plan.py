"""What a run would do and what it would cost, without doing it.

Idea     what is missing comes from the manifest. Costs come from the journals of this run directory, sizes from its
         files; what they do not tell is measured on a few fields of the cell, computed here and thrown away.
Limits   good to some ten per cent where the number of photons varies little between fields. Compilation of procedures
         that this machine has never run, some ten seconds each, and the report are not in it. Wall times are for
         workers that have a core each.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from survey_mc.campaign import Campaign, Cell, expand
from survey_mc.run.engine import default_run_dir, refuse_foreign
from survey_mc.run.gaps import known_gaps
from survey_mc.run.order import Order
from survey_mc.run.plan.costs import JournalCosts, Sample, Stage, sample
from survey_mc.run.plan.pace import FIRST_FIELDS, ORDER_SECONDS, PACKING_PER_COMMIT, block_size
from survey_mc.run.stages import table_of
from survey_mc.run.work import families_of, orders, shards
from survey_mc.store import Family, Manifest, RunData, RunLayout
from survey_mc.store.parquet import empty_frame, encoded_bytes

PACK: Stage = ("", "pack")
RESTORED_S = 0.002  # CPU of giving the stored detections of a field to its matching
ORDERS_AHEAD = 3  # of each worker, before anything is known of their pace
# Measured on an unshared machine: a local cluster with its workers' imports; what the driver does for an order; wall
# over CPU of a worker, which waits for the disk and for the next order.
CLUSTER_START_S = 4.0
ORDER_S = 0.015
WALL_PER_CPU = 1.05


@dataclass(frozen=True, slots=True)
class CellPlan:
    """One cell: fields the campaign asks for, fields with work left, and what that work takes.

    stages: CPU seconds by method label (empty: drawing, truth) and stage (draw, detect, match, commit, pack).
    size_bytes, new_files: what is added to the store. orders: tasks. sampled: whether fields were computed to find out.
    """

    label: str
    fields: int
    to_do: int
    stages: Mapping[Stage, float] = field(default_factory=dict)
    size_bytes: int = 0
    new_files: int = 0
    orders: int = 0
    sampled: bool = False
    problems: tuple[str, ...] = ()

    @property
    def cpu_s(self) -> float:
        return sum(self.stages.values())


@dataclass(frozen=True, slots=True)
class CampaignPlan:
    """A whole run. block: the most fields in a task. files: stored files when complete.

    measured: where the costs come from ("journal", "journal and a few fields", "a few fields" or "nothing to do").
    problems: what failed on the fields that were computed to measure, whose costs are then too low.
    """

    root: Path
    cells: tuple[CellPlan, ...]
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
    def new_files(self) -> int:
        return sum(cell.new_files for cell in self.cells)

    @property
    def orders(self) -> int:
        return sum(cell.orders for cell in self.cells)

    @property
    def to_do(self) -> int:
        return sum(cell.to_do for cell in self.cells)

    @property
    def fields(self) -> int:
        return sum(cell.fields for cell in self.cells)

    @property
    def stages(self) -> dict[Stage, float]:
        """CPU seconds by method label and stage, over all cells."""
        sums: defaultdict[Stage, float] = defaultdict(float)
        for cell in self.cells:
            for stage, cpu_s in cell.stages.items():
                sums[stage] += cpu_s
        return dict(sums)

    def wall_s(self, workers: int) -> float:
        """Seconds that a run takes with so many local workers, each on a core of its own; the report not included.

        The workers rehearse a field first; the driver, which packs and keeps the books, shares their cores; and at the
        end some wait for the last order.
        """
        if not self.orders:
            return 0.0
        used = max(1, min(workers, self.orders))
        driver_s = self.stages.get(PACK, 0.0) + ORDER_S * self.orders
        worker_s = WALL_PER_CPU * (self.cpu_s - self.stages.get(PACK, 0.0))
        rehearsal_s, order_s = worker_s / max(self.to_do, 1), worker_s / self.orders
        return CLUSTER_START_S + rehearsal_s + (worker_s + driver_s) / used + order_s * (used - 1) / (2 * used)


def plan_campaign(campaign: Campaign, out: Path | str | None = None, workers: int = 1) -> CampaignPlan:
    """Tasks, fields done and to do, expected CPU time, bytes and files; nothing is written."""
    layout = RunLayout(Path(out).absolute() if out is not None else default_run_dir(campaign).absolute())
    refuse_foreign(campaign, layout)
    cells = expand(campaign)
    manifest, spent = Manifest(layout.manifest), JournalCosts()
    entries = RunData(layout.root).journal_lines() if layout.lock_file.is_file() else ()
    left_alone = known_gaps(spent.noted(entries)).left_alone
    per_file = campaign.store.realisations_per_file
    todo = [list(orders(campaign, (cell,), manifest, layout.root, per_file, left_alone)) for cell in cells]
    n_fields = sum(order.n_fields for mine in todo for order in mine)
    most = block_size(n_fields, workers, per_file)
    plans = tuple(
        _plan_of_cell(campaign, _Work.of(cell, mine), spent.of(cell), manifest, most, workers)
        for cell, mine in zip(cells, todo, strict=True)
    )
    n_files = sum(1 for cell in cells for _ in shards(cell.realisations, per_file) for _ in families_of(cell))
    told = any(spent.of(cell) for cell, mine in zip(cells, todo, strict=True) if mine)
    sources = [name for name, used in (("journal", told), ("a few fields", any(p.sampled for p in plans))) if used]
    problems = tuple(problem for plan in plans for problem in plan.problems)
    return CampaignPlan(layout.root, plans, most, n_files, " and ".join(sources) or "nothing to do", problems)


@dataclass(frozen=True, slots=True)
class _Work:
    """What is to be done in a cell: fields to go through each stage, and fields for each family of files."""

    cell: Cell
    mine: list[Order]
    stages: dict[Stage, int]
    files: dict[Family, int]
    labels: dict[Family, str]

    @classmethod
    def of(cls, cell: Cell, mine: list[Order]) -> _Work:
        stages: defaultdict[Stage, int] = defaultdict(int)
        files: defaultdict[Family, int] = defaultdict(int)
        labels: dict[Family, str] = {}

        def book(label: str, stage: str, families: Iterable[Family], n: int) -> None:
            stages[label, stage] += n
            for family in families:
                files[family] += n
                labels[family] = label
                stages[label, "commit"] += n

        methods = {method.label: method for method in cell.methods}
        for order in mine:
            book("", "draw", [Family("truth", cell.field_key)] if order.truth else [], order.n_fields)
            for label in order.detect:
                book(label, "detect", [Family("detections", methods[label].detect_key)], order.n_fields)
            for label in order.match:
                key = methods[label].match_key
                book(label, "match", [Family("matches", key), Family("links", key)], order.n_fields)
        return cls(cell, mine, dict(stages), dict(files), labels)

    @property
    def fields(self) -> int:
        return sum(order.n_fields for order in self.mine)


def _plan_of_cell(
    campaign: Campaign, work: _Work, known: Mapping[Stage, float], manifest: Manifest, most: int, workers: int
) -> CellPlan:
    cell = work.cell
    if not work.mine:
        return CellPlan(cell.label, cell.realisations, 0)
    sizes = {family: _stored_size(cell, manifest, family, work.labels[family]) for family in work.files}
    unknown = {label for label, stage in work.stages if (label, stage) not in known}
    unknown |= {work.labels[family] for family, size in sizes.items() if size is None}
    few = sample(campaign, cell, unknown) if unknown else Sample({}, {}, ())
    costs = few.stages | dict(known)
    field_s = sum(costs.get(stage, 0.0) * n for stage, n in work.stages.items()) / work.fields
    block = max(1, min(most, int(ORDER_SECONDS / max(field_s, 1e-9))))
    costs = few.commits(block) | costs
    stages = {stage: costs.get(stage, 0.0) * n for stage, n in work.stages.items()}
    for order in work.mine:
        for label in set(order.match) - set(order.detect):
            stages[label, "match"] += RESTORED_S * order.n_fields
    stages[PACK] = (
        PACKING_PER_COMMIT
        * _share_packed(work, campaign, block, workers)
        * sum(cpu_s for (_, stage), cpu_s in stages.items() if stage == "commit")
    )
    new_files = {family: _new_files(work, campaign, manifest, family) for family in work.files}
    size_bytes = 0.0
    for family, n in work.files.items():
        file_bytes, field_bytes = sizes[family] or _sampled_size(few, family)
        size_bytes += file_bytes * new_files[family] + field_bytes * n
    n_orders = sum(-(-order.n_fields // block) for order in work.mine)
    return CellPlan(
        cell.label,
        cell.realisations,
        work.fields,
        stages,
        int(size_bytes),
        sum(new_files.values()),
        n_orders,
        bool(unknown),
        few.problems,
    )


def _stored_size(cell: Cell, manifest: Manifest, family: Family, label: str) -> tuple[float, float] | None:
    """Bytes of a file by itself and of each field in it, as they are in the files a family has; None without any."""
    records = manifest.records(family)
    fields = sum(record.piece.stop - record.piece.start for record in records)
    if not fields:
        return None
    name = next((method.name for method in cell.methods if method.label == label), "")
    table = table_of(family.table, name)
    file_bytes = encoded_bytes(table, empty_frame(table))
    stored = sum(record.size_bytes for record in records)
    return file_bytes, max(0.0, stored - len(records) * file_bytes) / fields


def _sampled_size(few: Sample, family: Family) -> tuple[float, float]:
    """The same as a sample tells; nothing where the method failed on all of its fields."""
    cost = few.files.get(family)
    return (0.0, 0.0) if cost is None else (cost.file_bytes, cost.field_bytes)


def _touched_shards(work: _Work, campaign: Campaign) -> list[tuple[int, int]]:
    per_file = campaign.store.realisations_per_file
    numbers = {order.start // per_file for order in work.mine}
    return [(n * per_file, min((n + 1) * per_file, work.cell.realisations)) for n in sorted(numbers)]


def _new_files(work: _Work, campaign: Campaign, manifest: Manifest, family: Family) -> int:
    """Files of a family that there are not yet; a shard that has parts of one gets its whole one in their place."""
    return sum(not manifest.covering(family, *shard) for shard in _touched_shards(work, campaign))


def _share_packed(work: _Work, campaign: Campaign, block: int, workers: int) -> float:
    """Share of the fields whose files are written in parts and then joined: those of the first orders, or all."""
    per_file = campaign.store.realisations_per_file
    if block < min(per_file, work.fields):
        return 1.0
    alone = FIRST_FIELDS * ORDERS_AHEAD * max(workers, 1)
    return min(1.0, -(-alone // per_file) * per_file / work.fields) if block > FIRST_FIELDS else 0.0
