"""Check a run: every file against the manifest, random fields against a fresh computation; repair damage."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.campaign import Campaign, Cell, CellMethod, expand, load_run_campaign
from survey_mc.errors import BadInput, DamagedStore
from survey_mc.rng import stream
from survey_mc.run.engine import RunSummary, run_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.pack import sweep
from survey_mc.run.simulate import replay
from survey_mc.run.stages import stack, stored_truth, table_of
from survey_mc.store import Damage, Family, Manifest, Piece, RunData, RunLayout, read_piece, run_lock, verify_store
from survey_mc.store.layout import StoredTable
from survey_mc.store.parquet import file_sha256

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(slots=True)
class VerifyResult:
    """files: files checked. damages: what is wrong with them. replayed: (cell, method, realisation) computed again.

    differences: sentences about replayed fields that did not come out the same. repaired: what the repairing run did.
    """

    files: int = 0
    damages: list[Damage] = field(default_factory=list)
    replayed: list[tuple[str, str, int]] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)
    repaired: RunSummary | None = None

    @property
    def sound(self) -> bool:
        """Nothing but what a killed run left over is wrong, and every replayed field came out the same."""
        return not self.differences and self.n_damaged == 0

    @property
    def n_damaged(self) -> int:
        """Damages without what a killed run left over."""
        return sum(damage.kind != "leftover" for damage in self.damages)


def verify_run(
    run_dir: Path | str,
    n_replay: int = 0,
    *,
    repair: bool = False,
    seed: int = 0,
    executor: ExecutorChoice | None = None,
    on_file: Callable[[str], None] = lambda path: None,
) -> VerifyResult:
    """Check all files, compute `n_replay` random stored fields again, and with `repair` remake what is damaged.

    seed: chooses which fields are replayed. After a repair `damages` still lists what was found.
    """
    layout = RunLayout(Path(run_dir).absolute())
    if not layout.lock_file.is_file():
        raise BadInput(str(layout.root), "is not a run directory (it has no campaign.lock.json)")
    manifest = Manifest(layout.manifest)
    result = VerifyResult(files=len(manifest))
    result.damages = [*_campaign_damages(layout), *verify_store(layout, manifest, on_file)]
    if repair and result.damages:
        result.repaired = _repair(layout, result.damages, executor)
        manifest = Manifest(layout.manifest)
    if n_replay:
        damaged = {damage.piece for damage in result.damages} if not repair else set()
        _replay_some(layout, manifest, n_replay, seed, result, damaged)
    return result


def _campaign_damages(layout: RunLayout) -> Iterator[Damage]:
    """The campaign and its sky images must be those that the lock file was made from."""
    lock = RunData(layout.root).lock
    inputs = {f"inputs/{path}": digest for path, digest in lock.get("inputs_sha256", {}).items()}
    for path, digest in {layout.campaign.name: lock.get("campaign_sha256"), **inputs}.items():
        file = layout.root / path
        if not file.is_file() or file_sha256(file) != digest:
            about = "is not what the run was made with; `survey-mc run` with the campaign file writes it again"
            yield Damage("campaign", path, about)


def _repair(layout: RunLayout, damages: list[Damage], executor: ExecutorChoice | None) -> RunSummary:
    campaign = load_run_campaign(layout.root)
    with run_lock(layout):
        manifest = Manifest(layout.manifest)
        pieces = [damage.piece for damage in damages if damage.piece is not None]
        manifest.drop(piece for piece in pieces if piece in manifest)
        for damage in damages:
            if damage.piece is not None or damage.kind == "extra":
                (layout.root / damage.path).unlink(missing_ok=True)
        manifest.compact()
        sweep(layout, manifest)
    return run_campaign(campaign, layout.root, executor)


def _replay_some(
    layout: RunLayout, manifest: Manifest, n_replay: int, seed: int, result: VerifyResult, damaged: set[Piece | None]
) -> None:
    campaign = load_run_campaign(layout.root)
    stored = [
        (cell, method, realisation)
        for cell in expand(campaign)
        for method in cell.methods
        for record in manifest.records(Family("matches", method.match_key))
        for realisation in range(record.piece.start, min(record.piece.stop, cell.realisations))
    ]
    if not stored:
        return
    rng = stream(f"{campaign.seed}/{seed}", "replay")
    for number in rng.choice(len(stored), size=min(n_replay, len(stored)), replace=False):
        cell, method, realisation = stored[int(number)]
        result.replayed.append((cell.label, method.label, realisation))
        result.differences.extend(_differences(campaign, cell, method, realisation, layout, manifest, damaged))


def _differences(
    campaign: Campaign,
    cell: Cell,
    method: CellMethod,
    realisation: int,
    layout: RunLayout,
    manifest: Manifest,
    damaged: set[Piece | None],
) -> list[str]:
    again = replay(campaign, cell, method.label, realisation)
    fresh: dict[StoredTable, tuple[str, DataFrame]] = {
        "truth": (cell.field_key, stored_truth(again.field)),
        "detections": (method.detect_key, again.detections),
        "matches": (method.match_key, again.matched.matches),
        "links": (method.match_key, again.matched.links),
    }
    found = []
    for table, (key, frame) in fresh.items():
        place = f"{cell.label} / {method.label} / realisation {realisation}: {table}"
        records = manifest.covering(Family(table, key), realisation, realisation + 1)
        if not records or records[0].piece in damaged:
            continue
        try:
            kept = read_piece(layout, records[0])
        except DamagedStore as problem:
            found.append(f"{place}: {problem}")
            continue
        kept = kept[kept["realisation"] == realisation].reset_index(drop=True)
        if not _same(kept, stack([(realisation, frame)], table_of(table, method.name))):
            found.append(f"{place}: computed again gives other rows than the stored ones")
    return found


def _same(kept: DataFrame, fresh: DataFrame) -> bool:
    """Equal to the last bit, NaN equal to NaN."""
    if list(kept.columns) != list(fresh.columns) or len(kept) != len(fresh):
        return False
    return all(kept[name].astype(object).equals(fresh[name].astype(object)) for name in kept.columns)
