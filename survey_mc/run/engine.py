"""Run a campaign: find what is missing, have it done, keep what is done.

Idea     the driver only hands out orders and writes the manifest and the journal; whatever happens to it or to a
         worker, starting again does what is missing and nothing else.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from survey_mc.campaign import Campaign, Cell, expand, load_campaign, lock_content
from survey_mc.campaign.inputs import resolve_input
from survey_mc.campaign.lock import library_versions
from survey_mc.errors import BadInput, SurveyError
from survey_mc.lock_form import lock_text, loose_content
from survey_mc.run.disk import disk_sentence, is_disk_problem
from survey_mc.run.executors import Executor, ExecutorChoice, open_executor, usable_cores
from survey_mc.run.gaps import Gaps, known_gaps
from survey_mc.run.harvest import Harvest, Progress
from survey_mc.run.journal import Journal
from survey_mc.run.order import Order
from survey_mc.run.pack import drop_superseded, pack_shard, sweep
from survey_mc.run.plan.pace import Pace, block_size
from survey_mc.run.quarantine.attempts import forget
from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.run.quarantine.suspects import equipped, find_suspects
from survey_mc.run.work import families_of, orders, shards
from survey_mc.store import Manifest, RunData, RunLayout, run_lock
from survey_mc.store.files import is_plain, temporary_path, what_it_is, write_whole

RESULTS_FOLDER = "results"


@dataclass(frozen=True, slots=True)
class RunSummary:
    """What a run did, and what is missing after it.

    fields: fields worked on. failed, skipped: (field, method) pairs that are missing because the method failed or
    declined. causes: how many failed in this run, by cause.
    """

    root: Path
    fields: int
    failed: int
    skipped: int
    causes: dict[str, int]

    @property
    def complete(self) -> bool:
        return self.failed == 0


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
    limits: FieldLimits | None = None,
    on_progress: Callable[[Progress], None] = lambda state: None,
) -> RunSummary:
    """Simulate, detect and match all that is missing in a run directory.

    campaign: a loaded campaign or the path of a file. out: run directory, default results/<name>. executor: default a
    local dask cluster on all cores; an opened one serves several runs. block: fields in one order, default chosen from
    the amount of work and its pace; no result depends on it. retry_failed: try again what failed or was skipped in an
    earlier run. limits: seconds and memory that a method may take on a field. Raises `SurveyError` (bad input, locked
    directory, full disk).
    """
    if not isinstance(campaign, Campaign):
        campaign = load_campaign(campaign)
    layout = RunLayout(Path(out).absolute() if out is not None else default_run_dir(campaign).absolute())
    choice = executor or ExecutorChoice()
    try:
        with run_lock(layout):
            return _run_locked(campaign, layout, choice, block, retry_failed, limits or FieldLimits(), on_progress)
    except OSError as problem:
        if is_disk_problem(problem):
            raise SurveyError(disk_sentence(layout, problem)) from None
        raise


def _run_locked(
    campaign: Campaign,
    layout: RunLayout,
    choice: ExecutorChoice | Executor,
    block: int | None,
    retry_failed: bool,
    limits: FieldLimits,
    on_progress: Callable[[Progress], None],
) -> RunSummary:
    cells = expand(campaign)
    refuse_foreign(campaign, layout)
    manifest = Manifest(layout.manifest)
    sweep(layout, manifest)
    if manifest.is_torn or manifest.damaged_lines or not layout.manifest.exists():
        manifest.compact()
    write_campaign(campaign, layout)
    gaps = Gaps() if retry_failed else known_gaps(RunData(layout.root).journal_lines())
    suspects = find_suspects(layout, cells)
    per_file = campaign.store.realisations_per_file
    pack_all(layout, manifest, cells, per_file, only_whole=True)
    left_alone = gaps.left_alone
    n_fields = sum(order.n_fields for order in orders(campaign, cells, manifest, layout.root, per_file, left_alone))
    if n_fields == 0:
        _tidy(layout, manifest, cells, per_file)
        return _summary(layout, cells, manifest, gaps, 0, {})
    most = block or block_size(n_fields, _expected_workers(choice), per_file)
    journal = Journal(layout)
    with _ended_on_purpose(layout), _opened(choice) as executor:
        journal.start(executor.name, executor.workers, n_fields, most)
        pace = Pace(most, fixed=block is not None, n_fields=n_fields, workers=executor.workers)
        harvest = Harvest(campaign, cells, layout, manifest, journal, gaps, pace)
        # Orders are made lazily, from the manifest as it is now, while the live one grows.
        todo = orders(campaign, cells, Manifest(layout.manifest), layout.root, pace.block, left_alone)
        versions = library_versions()

        def sent() -> Iterator[Order]:
            for order in todo:
                pace.hand_out(order.n_fields)
                yield equipped(order, cells[order.cell_index], limits, suspects, versions)

        harvest.gather(executor, sent(), n_fields, on_progress)
    forget(layout.attempts)
    _tidy(layout, manifest, cells, per_file)
    summary = _summary(layout, cells, manifest, gaps, n_fields, harvest.causes)
    journal.finish(fields=n_fields, failed=summary.failed, skipped=summary.skipped, causes=summary.causes)
    return summary


def _opened(choice: ExecutorChoice | Executor) -> AbstractContextManager[Executor]:
    return open_executor(choice) if isinstance(choice, ExecutorChoice) else nullcontext(choice)


@contextmanager
def _ended_on_purpose(layout: RunLayout) -> Iterator[None]:
    """Who interrupts a run stops its workers himself: what they were at is not suspect."""
    try:
        yield
    except KeyboardInterrupt:
        forget(layout.attempts)
        raise


def _expected_workers(choice: ExecutorChoice | Executor) -> int:
    if isinstance(choice, ExecutorChoice):
        return 1 if choice.serial else choice.workers or usable_cores()
    return choice.workers


def _tidy(layout: RunLayout, manifest: Manifest, cells: tuple[Cell, ...], per_file: int) -> None:
    """Leave a run whose files do not tell how the work was scheduled or interrupted."""
    pack_all(layout, manifest, cells, per_file, only_whole=False)
    drop_superseded(layout, manifest)
    manifest.compact()


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
    if what_it_is(layout.lock_file):
        name = loose_content(layout.lock_file)[0].get("name", campaign.name)  # if damaged, it is about to be replaced
        if name != campaign.name:
            raise BadInput(
                str(layout.root), f"holds a run of the campaign {name!r}, not of {campaign.name!r}; give another --out"
            )
        return
    if is_plain(layout.campaign) and layout.campaign.read_bytes() == campaign.text.encode():
        return
    parts = (layout.campaign, layout.manifest, layout.store.parent, layout.journals)
    taken = [path.name for path in parts if what_it_is(path)]
    if taken:
        raise BadInput(str(layout.root), f"is no run directory and has a {taken[0]} already; give another --out")


def write_campaign(campaign: Campaign, layout: RunLayout) -> None:
    """Put the campaign, the files it names and the lock file into the run directory."""
    if not campaign.text:
        raise SurveyError(
            "a campaign made in Python must be given as TOML text (parse_campaign) so that it can be kept"
        )
    _replace(layout.campaign, campaign.text)
    for path in campaign.input_digests:
        _copy_input(layout, path, resolve_input(path, campaign.folder, "campaign"))
    _replace(layout.lock_file, lock_text(lock_content(campaign)))


def _replace(path: Path, text: str) -> None:
    if not (is_plain(path) and path.read_bytes() == text.encode()):
        write_whole(path, text.encode())


def _copy_input(layout: RunLayout, path: str, source: Path) -> None:
    copy = layout.inputs / path
    if is_plain(copy) and copy.samefile(source):
        return
    for folder in copy.relative_to(layout.root).parents:
        if what_it_is(layout.root / folder) == "a link":
            raise BadInput(str(layout.root / folder), "is a link, and a run writes nothing outside its directory")
    copy.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_path(copy)
    try:
        shutil.copyfile(source, temporary)
        temporary.replace(copy)
    finally:
        temporary.unlink(missing_ok=True)


def _summary(
    layout: RunLayout, cells: tuple[Cell, ...], manifest: Manifest, gaps: Gaps, n_fields: int, causes: dict[str, int]
) -> RunSummary:
    lacking = skipped = 0
    for cell in cells:
        for method in cell.methods:
            lacking += cell.realisations - manifest.n_realisations("matches", method.match_key, cell.realisations)
            skipped += sum(number < cell.realisations for number in gaps.skipped.get(method.detect_key, ()))
    return RunSummary(layout.root, n_fields, max(0, lacking - skipped), skipped, dict(causes))
