"""Make a run directory of any number of realisations in minutes: a small real run, its stored pieces multiplied.

Every file is committed as the engine commits it, with its line in the manifest and the journal; only the fields repeat.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from survey_mc.campaign import Campaign, expand, parse_campaign
from survey_mc.run import run_campaign
from survey_mc.run.engine import write_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.stages import table_of
from survey_mc.run.work import Range, families_of, shards
from survey_mc.store import Family, Manifest, Piece, RunData, RunLayout, commit_piece
from survey_mc.store.journal_lines import seal_line

TINY = """
schema = 1
name = "{name}"
seed = 11

[instrument]
name = "xmm_epic"
n_pix = 64
field_of_view = false

[sky]
kind = "lognlogs"
flux_min_cgs = 1e-15

[grid]
band = ["soft"]
exposure_ks = [10.0]
realisations = {realisations}

[[method]]
name = "gauss_se"

[match]
region_arcmin = 4.0
counts_min = 10

[store]
realisations_per_file = {per_file}
"""
SHARDS_COMPUTED = 4
LINES_AT_ONCE = 500
IN_A_ROW = 10


def tiny_campaign(n_realisations: int, per_file: int = 64, name: str = "tiny") -> Campaign:
    """64-pixel fields that G+SE takes a few milliseconds for."""
    text = TINY.format(name=name, realisations=n_realisations, per_file=per_file)
    return parse_campaign(text, f"{name}.toml")


def make_big_run(root: Path, n_realisations: int, per_file: int = 64, n_failures: int = 0) -> Path:
    """A finished run of `n_realisations` tiny fields; some failed in their procedure, ten in a row each."""
    campaign = tiny_campaign(n_realisations, per_file)
    n_computed = min(n_realisations, SHARDS_COMPUTED * per_file)
    run_campaign(tiny_campaign(n_computed, per_file), root, ExecutorChoice(serial=True))
    rows = range(0, n_realisations, max(n_realisations * IN_A_ROW // n_failures, IN_A_ROW)) if n_failures else ()
    failed = {first + n for first in rows for n in range(IN_A_ROW)}
    _multiply(campaign, RunLayout(root), n_realisations, per_file, failed)
    write_campaign(campaign, RunLayout(root))
    return root


def _multiply(campaign: Campaign, layout: RunLayout, n_realisations: int, per_file: int, failed: set[int]) -> None:
    (cell,) = expand(campaign)
    (method,) = cell.methods
    computed = RunData(layout.root)
    names = {family: "" if family.table == "truth" else method.label for family in families_of(cell)}
    frames = {family: list(computed.frames(family.table, cell.label, names[family])) for family in names}
    (journal,) = layout.journals.glob("*.jsonl")
    start, *tasks, finish = computed.journal_lines()
    layout.manifest.unlink()
    manifest, records, lines = Manifest(layout.manifest), [], [start]
    for number, shard in enumerate(shards(n_realisations, per_file)):
        for family, computed_frames in frames.items():
            frame = computed_frames[number % len(computed_frames)]
            frame = frame.assign(realisation=(frame["realisation"] % per_file + shard[0]).astype("int32"))
            gaps = set() if family.table == "truth" else failed
            for start, stop in _without(shard, gaps):
                rows = frame[(frame["realisation"] >= start) & (frame["realisation"] < stop)]
                table = table_of(family.table, method.name)
                records.append(commit_piece(layout, Piece(Family(family.table, family.key), start, stop), table, rows))
        task = tasks[number % len(tasks)]
        lines.append({**task, "start": shard[0], "stop": shard[1]})
        lines.extend(
            _failure(cell.label, method.label, method.detect_key, j) for j in sorted(failed & set(range(*shard)))
        )
        if len(records) >= LINES_AT_ONCE:
            manifest.add(records)
            records = []
    manifest.add(records)
    manifest.compact()
    journal.write_text("".join(seal_line(line) for line in (*lines, finish)), encoding="utf-8")


def _without(shard: Range, gaps: set[int]) -> Iterator[Range]:
    start = shard[0]
    for place in (*sorted(gaps & set(range(*shard))), shard[1]):
        if start < place:
            yield start, place
        start = place + 1


def _failure(cell: str, method: str, key: str, realisation: int) -> dict[str, object]:
    """A journal line as long as real ones are."""
    return {
        "event": "failure",
        "cell": cell,
        "realisation": realisation,
        "method": method,
        "key": key,
        "stage": "detect",
        "error": f"ValueError: field {realisation} is not to its taste",
        "trace": "Traceback (most recent call last):\n" + '  File "procedure.py", line 1, in detect\n' * 30,
        "replay": f"survey-mc replay run --cell 0 --realisation {realisation} --method {method}",
    }
