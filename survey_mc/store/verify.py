"""Is everything in a run directory what it was when it was written?

Idea     SHA-256 sees every flipped bit; on top, a stored file must open, carry its declared schema and have its rows.
         The manifest is checked line by line, campaign and inputs against the lock file, that against itself, journals
         line by line, tables and report against their list. What is left in the run's own folders is named, too. Every
         file is read once and nothing is held but the manifest, so memory does not grow with the number of rows.
Limits   a journal, or a manifest, that was cut at the end of a line looks like that of a killed run: the stored files
         that lost their line are then found as leftovers. A file may be read while a run replaces it; what is wrong is
         therefore held against the manifest as it is in the end.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import pyarrow as pa

from survey_mc.lock_form import loose_content
from survey_mc.store.damage import Damage
from survey_mc.store.digest_list import read_digests, table_damages
from survey_mc.store.files import file_sha256, is_plain, what_it_is
from survey_mc.store.journal_lines import read_lines, torn_end
from survey_mc.store.layout import OWN_FOLDERS, STORE_FOLDER, Piece, RunLayout
from survey_mc.store.lock_file import lock_problem
from survey_mc.store.manifest import Manifest, Record
from survey_mc.store.stored_rows import batches, parquet_file, schema_problem
from survey_mc.store.strays import FROM_KILLED, strays, unfinished_writes
from survey_mc.store.upgrades import is_present

OTHER_CAMPAIGN = "is not what the run was made with; `survey-mc run` with the campaign file writes it again"


def verify_directory(
    layout: RunLayout, manifest: Manifest, on_file: Callable[[str], None] = lambda path: None
) -> Iterator[Damage]:
    """All that is wrong with a run directory. manifest: read as `tolerant`. on_file: called before each stored file."""
    wrong_lock = lock_problem(layout.lock_file)
    # A damaged lock file is no witness against others.
    lock = {} if wrong_lock else loose_content(layout.lock_file)[0]
    if wrong_lock:
        yield Damage("lock", layout.lock_file.name, wrong_lock)
    yield from _campaign_damages(layout, lock)
    yield from verify_store(layout, manifest, on_file)
    yield from _journal_damages(layout)
    yield from table_damages(layout, required="digest" in lock)
    inputs = None if wrong_lock else set(lock.get("inputs_sha256", {}))
    for path in unfinished_writes(layout):
        yield Damage("leftover", path.relative_to(layout.root).as_posix(), FROM_KILLED)
    others = [name for name in OWN_FOLDERS if name != STORE_FOLDER]
    yield from strays(layout, manifest, inputs, read_digests(layout), others)


def verify_store(
    layout: RunLayout, manifest: Manifest, on_file: Callable[[str], None] = lambda path: None
) -> Iterator[Damage]:
    """Check the manifest, every file that it names, and what else lies in the store. on_file is called before each."""
    name = layout.manifest.name
    if not is_plain(layout.manifest):
        what = what_it_is(layout.manifest)
        yield Damage("manifest", name, f"is {what}, not a file" if what else "is missing")
    for number, why in manifest.damaged_lines.items():
        yield Damage("manifest", name, f"line {number} {why}")
    for record in manifest:
        on_file(record.piece.path)
        damage = _check_record(layout, record)
        if damage is not None:
            yield damage
    yield from strays(layout, manifest, folders=(STORE_FOLDER,))


def still_wrong(damages: list[Damage], layout: RunLayout) -> list[Damage]:
    """Without what a run has done meanwhile: files that it packed or entered since the manifest was read."""
    now = Manifest(layout.manifest, tolerant=True)

    def is_wrong(damage: Damage) -> bool:
        piece = damage.piece
        return piece is None or (piece in now) == (damage.kind != "leftover")

    return [damage for damage in damages if is_wrong(damage)]


def _check_record(layout: RunLayout, record: Record) -> Damage | None:
    path, name = layout.root / record.piece.path, record.piece.path
    if not is_plain(path):
        what = what_it_is(path)
        if what:
            return Damage("changed", name, f"is {what}, not a file")
        return Damage("missing", name, "is in the manifest and not on disk")
    size = path.stat().st_size
    if size != record.size_bytes:
        return Damage("changed", name, f"has {size} bytes, {record.size_bytes} were written")
    content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != record.sha256:
        return Damage("changed", name, "has another SHA-256 than when it was written")
    try:
        file = parquet_file(content)
        wrong = schema_problem(record, file.schema_arrow)
        if wrong:
            return Damage("schema", name, wrong)
        is_present(record.piece.family.table, record.schema_version, str(path))
        n_rows = sum(batch.num_rows for batch in batches(file))
    except (OSError, pa.ArrowException) as problem:
        return Damage("unreadable", name, f"cannot be read: {str(problem)[:120]}")
    return None if n_rows == record.rows else Damage("rows", name, f"has {n_rows} rows, {record.rows} were written")


def _campaign_damages(layout: RunLayout, lock: dict[str, Any]) -> Iterator[Damage]:
    """The campaign and its inputs must be those that the lock file was made from."""
    if "campaign_sha256" in lock and not _is_file_of(layout.campaign, lock["campaign_sha256"]):
        yield Damage("campaign", layout.campaign.name, OTHER_CAMPAIGN)
    for path, digest in lock.get("inputs_sha256", {}).items():
        pure = PurePosixPath(path)
        is_inside = "\0" not in path and not pure.is_absolute() and ".." not in pure.parts
        if not is_inside or not _is_file_of(layout.inputs / pure, digest):
            yield Damage("campaign", f"inputs/{path}", OTHER_CAMPAIGN)


def _is_file_of(path: Path, digest: str) -> bool:
    return is_plain(path) and file_sha256(path) == digest


def _journal_damages(layout: RunLayout) -> Iterator[Damage]:
    for path in layout.journal_files():
        name = path.relative_to(layout.root).as_posix()
        if not is_plain(path):
            yield Damage("journal", name, f"is {what_it_is(path)}, not a file")
            continue
        for number, content in read_lines(path):
            if content is None:
                yield Damage("journal", name, f"line {number} is damaged")
        if (end := torn_end(path)) is not None:
            number, is_odd = end
            about = "has another end than that of a line" if is_odd else "was not finished by a killed run"
            yield Damage("journal" if is_odd else "leftover", name, f"line {number} {about}")


def damaged_pieces(damages: list[Damage]) -> set[Piece]:
    """The stored files among what is wrong."""
    return {damage.piece for damage in damages if damage.piece is not None}
