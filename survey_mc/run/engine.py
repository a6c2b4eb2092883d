"""Run a campaign: find what is missing, have it done, keep what is done.

Idea     the driver only hands out orders and writes the manifest and the journal; whatever happens to it or to a
         worker, starting again does what is missing and nothing else.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from survey_mc.campaign import Campaign, Cell, expand, load_campaign, lock_content
from survey_mc.campaign.inputs import resolve_input
from survey_mc.errors import BadInput, SurveyError
from survey_mc.run.executors import Executor, ExecutorChoice, open_executor, usable_cores
from survey_mc.run.journal import Journal, known_failures
from survey_mc.run.pack import drop_superseded, pack_shard, sweep
from survey_mc.run.task import Order, Outcome
from survey_mc.run.work import NO_FAILURES, block_size, families_of, orders, shards
from survey_mc.store import Manifest, RunData, RunLayout, run_lock

RESULTS_FOLDER = "results"
_DISK_PROBLEMS = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EACCES}


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a run after an order: fields done and to do in this run, and failures so far by method label."""

    done: int
    total: int
    failures: dict[str, int]


@dataclass(frozen=True, slots=True)
class RunSummary:
    """What a run did. fields: fields worked on; failed: (field, method) pairs that are missing because they failed."""

    root: Path
    fields: int
    failed: int
    skipped: int
    quarantined: int

    @property
    def complete(self) -> bool:
        return self.failed == 0 and self.quarantined == 0


def default_run_dir(campaign: Campaign) -> Path:
    """results/<name> below the current folder."""
    return Path(RESULTS_FOLDER) / campaign.name


def run_campaign(
    campaign: Campaign | Path | str,
    out: Path | str | None = None,
    executor: ExecutorChoice | Executor | None = None,
    *,
    block: int | None = None,
    retry_failed: bool = False,
    on_progress: Callable[[Progress], None] = lambda state: None,
) -> RunSummary:
    """Simulate, detect and match all that is missing in a run directory.

    campaign: a loaded campaign or the path of a file. out: run directory, default results/<name>. executor: default a
    local dask cluster on all cores; an opened one serves several runs. block: fields in one order, default chosen from
    the amount of work; no result depends on it. retry_failed: try again what failed in an earlier run. Raises
    `SurveyError` (bad input, locked directory, full disk).
    """
    if not isinstance(campaign, Campaign):
        campaign = load_campaign(campaign)
    layout = RunLayout(Path(out).absolute() if out is not None else default_run_dir(campaign).absolute())
    choice = executor or ExecutorChoice()
    try:
        with run_lock(layout):
            return _run_locked(campaign, layout, choice, block, retry_failed, on_progress)
    except OSError as problem:
        if problem.errno in _DISK_PROBLEMS or isinstance(problem, NotADirectoryError | FileExistsError):
            raise SurveyError(f"{layout.root}: cannot be written: {problem.strerror}; what is stored is safe") from None
        raise


def _run_locked(
    campaign: Campaign,
    layout: RunLayout,
    choice: ExecutorChoice | Executor,
    block: int | None,
    retry_failed: bool,
    on_progress: Callable[[Progress], None],
) -> RunSummary:
    cells = expand(campaign)
    refuse_foreign(campaign, layout)
    manifest = Manifest(layout.manifest)
    sweep(layout, manifest)
    if manifest.is_torn or manifest.unreadable_lines or not layout.manifest.exists():
        manifest.compact()
    write_campaign(campaign, layout)
    failed = NO_FAILURES if retry_failed else known_failures(RunData(layout.root).journal_lines())
    per_file = campaign.store.realisations_per_file
    pack_all(layout, manifest, cells, per_file, only_whole=True)
    n_fields = sum(order.n_fields for order in orders(campaign, cells, manifest, layout.root, per_file, failed))
    if n_fields == 0:
        _tidy(layout, manifest, cells, per_file)
        return _summary(layout, cells, manifest, 0, 0, 0)
    block = block or block_size(n_fields, _expected_workers(choice), per_file)
    journal = Journal(layout)
    with open_executor(choice) if isinstance(choice, ExecutorChoice) else nullcontext(choice) as executor:
        journal.start(executor.name, executor.workers, n_fields, block)
        # Orders are made lazily, from the manifest as it is now, while the live one grows.
        todo = orders(campaign, cells, Manifest(layout.manifest), layout.root, block, failed)
        skipped, quarantined = _harvest(
            executor.execute(todo), n_fields, cells, campaign, layout, manifest, journal, on_progress
        )
    _tidy(layout, manifest, cells, per_file)
    summary = _summary(layout, cells, manifest, n_fields, skipped, quarantined)
    journal.finish(fields=n_fields, failed=summary.failed, skipped=skipped, quarantined=quarantined)
    return summary


def _expected_workers(choice: ExecutorChoice | Executor) -> int:
    if isinstance(choice, ExecutorChoice):
        return 1 if choice.serial else choice.workers or usable_cores()
    return choice.workers


def _tidy(layout: RunLayout, manifest: Manifest, cells: tuple[Cell, ...], per_file: int) -> None:
    """Leave a run whose files do not tell how the work was scheduled or interrupted."""
    pack_all(layout, manifest, cells, per_file, only_whole=False)
    drop_superseded(layout, manifest)
    manifest.compact()


def _harvest(
    results: Iterator[tuple[Order, Outcome | Exception]],
    n_fields: int,
    cells: tuple[Cell, ...],
    campaign: Campaign,
    layout: RunLayout,
    manifest: Manifest,
    journal: Journal,
    on_progress: Callable[[Progress], None],
) -> tuple[int, int]:
    """Enter finished orders into the manifest and the journal; the numbers of skips and of quarantined fields."""
    done = skipped = quarantined = 0
    failures: dict[str, int] = {}
    on_progress(Progress(0, n_fields, {}))
    for order, result in results:
        cell = cells[order.cell_index]
        keys = {"": cell.field_key} | {m.label: m.detect_key for m in cell.methods}
        if isinstance(result, Exception):
            if isinstance(result, OSError | SurveyError):
                raise result
            quarantined += order.n_fields
            failures["(whole task)"] = failures.get("(whole task)", 0) + order.n_fields
            wanted = {label: keys[label] for label in {*order.detect, *order.match}}
            journal.quarantine(cell.label, order, wanted, f"{type(result).__name__}: {result}", str(layout.root))
        else:
            manifest.add(result.records)
            journal.task(cell.label, order, result, keys, str(layout.root))
            skipped += len(result.skips)
            for failure in result.failures:
                name = failure.method or "(drawing)"
                failures[name] = failures.get(name, 0) + 1
            _pack_where_done(layout, manifest, cell, order, campaign.store.realisations_per_file)
        done += order.n_fields
        on_progress(Progress(done, n_fields, dict(failures)))
    return skipped, quarantined


def _pack_where_done(layout: RunLayout, manifest: Manifest, cell: Cell, order: Order, per_file: int) -> None:
    start = order.start // per_file * per_file
    shard = (start, min(start + per_file, cell.realisations))
    for family in families_of(cell):
        pack_shard(layout, manifest, family, shard, only_whole=True)


def pack_all(
    layout: RunLayout, manifest: Manifest, cells: tuple[Cell, ...], per_file: int, *, only_whole: bool
) -> None:
    """Join adjacent parts in every shard; a failed field leaves a gap between two files and nothing else."""
    for cell in cells:
        for shard in shards(cell.realisations, per_file):
            for family in families_of(cell):
                pack_shard(layout, manifest, family, shard, only_whole=only_whole)


def refuse_foreign(campaign: Campaign, layout: RunLayout) -> None:
    """Raise `BadInput` for a folder that holds the run of another campaign, or files that a run would overwrite."""
    if layout.lock_file.is_file():
        try:
            name = json.loads(layout.lock_file.read_text(encoding="utf-8"))["name"]
        except (ValueError, KeyError, TypeError):
            return  # damaged, and about to be written again
        if name != campaign.name:
            raise BadInput(
                str(layout.root), f"holds a run of the campaign {name!r}, not of {campaign.name!r}; give another --out"
            )
        return
    if layout.campaign.is_file() and layout.campaign.read_bytes() == campaign.text.encode():
        return
    taken = [p.name for p in (layout.campaign, layout.manifest, layout.store.parent, layout.journals) if p.exists()]
    if taken:
        raise BadInput(str(layout.root), f"is no run directory and has a {taken[0]} already; give another --out")


def write_campaign(campaign: Campaign, layout: RunLayout) -> None:
    """Put the campaign, the files it names and the lock file into the run directory."""
    if not campaign.text:
        raise SurveyError(
            "a campaign made in Python must be given as TOML text (parse_campaign) so that it can be kept"
        )
    lock_text = json.dumps(lock_content(campaign), indent=1, sort_keys=True) + "\n"
    _replace(layout.campaign, campaign.text)
    for path in campaign.input_digests:
        copy = layout.root / "inputs" / path
        source = resolve_input(path, campaign.folder, "campaign")
        if not (copy.exists() and copy.samefile(source)):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)
    _replace(layout.lock_file, lock_text)


def _replace(path: Path, text: str) -> None:
    if path.exists() and path.read_text(encoding="utf-8") == text:
        return
    temporary = path.with_name(f".{path.name}.tmp")
    with temporary.open("w", encoding="utf-8", newline="") as handle:
        handle.write(text)
        handle.flush()
        os.fsync(handle.fileno())
    temporary.replace(path)


def _summary(
    layout: RunLayout, cells: tuple[Cell, ...], manifest: Manifest, n_fields: int, skipped: int, quarantined: int
) -> RunSummary:
    lacking = 0
    for cell in cells:
        for method in cell.methods:
            done = manifest.n_realisations("matches", method.match_key, cell.realisations)
            lacking += cell.realisations - done
    return RunSummary(layout.root, n_fields, max(0, lacking - skipped), skipped, quarantined)
