"""Check a run: files against what they were when written, random fields against a fresh computation; repair."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from survey_mc.campaign import load_run_campaign
from survey_mc.errors import BadInput, SurveyError
from survey_mc.run.engine import RunSummary
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.run.verify.repair import compute_again, mend
from survey_mc.run.verify.replay import differences, sample
from survey_mc.store import Damage, Manifest, RunLayout, run_lock, verify_directory
from survey_mc.store.files import is_plain, set_aside, what_it_is
from survey_mc.store.lock_file import read_lock
from survey_mc.store.replacement import finish_replacements
from survey_mc.store.verify import damaged_pieces, still_wrong


@dataclass(slots=True)
class VerifyResult:
    """files: files in the manifest. damages: all that is wrong. replayed: (cell, method, realisation) computed again.

    differences: sentences about fields that did not come out the same and about what could not be put right. repaired:
    what the repairing run did. lacking: (field, method) pairs that the campaign asks for and that are not stored,
    whatever the reason.
    """

    files: int = 0
    damages: list[Damage] = field(default_factory=list)
    replayed: list[tuple[str, str, int]] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)
    repaired: RunSummary | None = None
    lacking: int = 0

    @property
    def sound(self) -> bool:
        """Nothing but what a killed run left over is wrong, and every replayed field came out the same."""
        return not self.differences and self.n_damaged == 0

    @property
    def n_damaged(self) -> int:
        """Damages without what a killed run left over."""
        return sum(damage.kind != "leftover" for damage in self.damages)

    @property
    def mended(self) -> bool:
        """All that was wrong has been put right."""
        return self.repaired is not None and self.repaired.complete and not self.differences


def verify_run(
    run_dir: Path | str,
    n_replay: int = 0,
    *,
    repair: bool = False,
    seed: int = 0,
    executor: ExecutorChoice | None = None,
    limits: FieldLimits | None = None,
    remake_report: Callable[[Path], object] | None = None,
    on_file: Callable[[str], None] = lambda path: None,
) -> VerifyResult:
    """Check all files, compute `n_replay` random stored fields again, and with `repair` remake what is damaged.

    seed: chooses which fields are replayed. limits: of the repairing run. remake_report: makes tables and report of the
    run directory again where they are damaged (`report.remake_report`). on_file is called with the path of each stored
    file before it is read. After a repair `damages` still lists what was found.
    """
    layout = RunLayout(Path(run_dir).absolute())
    _refuse_other(layout)
    result = VerifyResult()
    manifest = Manifest(layout.manifest, tolerant=True)
    mended = None
    with _held(layout) if repair else nullcontext():
        if repair:
            # What another process did since then, or left in the middle, is no damage.
            manifest = Manifest(layout.manifest, tolerant=True)
            finish_replacements(layout, manifest)
        result.files = len(manifest)
        result.damages = list(verify_directory(layout, manifest, on_file))
        if result.damages and not repair:
            result.damages = still_wrong(result.damages, layout)
        if result.damages and repair:
            mended = mend(layout, manifest, result.damages)
    if mended is not None:
        result.repaired, result.differences = compute_again(layout, mended, executor, limits)
        if mended.tables:
            _remake(layout, remake_report, result)
        manifest = Manifest(layout.manifest, tolerant=True)
    result.lacking = _n_lacking(layout, manifest)
    if n_replay:
        _replay_some(layout, manifest, n_replay, seed, result)
    return result


def _refuse_other(layout: RunLayout) -> None:
    """Raise `BadInput` for what is no run directory; one that has lost its lock file still has the rest."""
    rest = (layout.campaign, layout.store)
    if not what_it_is(layout.lock_file) and not all(what_it_is(path) for path in rest):
        raise BadInput(str(layout.root), "is not a run directory (it has no campaign.lock.json)")


def _held(layout: RunLayout) -> AbstractContextManager[None]:
    if what_it_is(layout.process_lock) and not is_plain(layout.process_lock):
        set_aside(layout.root, layout.process_lock.name, layout.strays)
    return run_lock(layout)


def _n_lacking(layout: RunLayout, manifest: Manifest) -> int:
    try:
        cells = read_lock(layout.lock_file)["cells"]
    except SurveyError:
        return 0
    wanted = [(key, cell["realisations"]) for cell in cells for key in cell["match_keys"].values()]
    return sum(number - manifest.n_realisations("matches", key, number) for key, number in wanted)


def _remake(layout: RunLayout, remake_report: Callable[[Path], object] | None, result: VerifyResult) -> None:
    if remake_report is None:
        result.differences.append(f"{layout.root}: tables or report are damaged; `survey-mc report` makes them again")
    else:
        remake_report(layout.root)


def _replay_some(layout: RunLayout, manifest: Manifest, n_replay: int, seed: int, result: VerifyResult) -> None:
    try:
        campaign = load_run_campaign(layout.root)
    except SurveyError as problem:
        result.differences.append(f"no field can be computed again: {problem}")
        return
    damaged = damaged_pieces(result.damages) if result.repaired is None else set()
    for cell, method, realisation in sample(campaign, manifest, n_replay, seed):
        result.replayed.append((cell.label, method.label, realisation))
        found = differences(campaign, (cell, method, realisation), layout, manifest, damaged)
        result.differences.extend(found)
