"""Write what older versions stored as today's version stores it.

Idea     file by file, each read through the upgrades, written beside, read back and compared, then put in its place;
         the manifest knows of it first. A migration may be killed at any time and started again. Lock and manifest end
         as today's version writes them.
Limits   bytes are those of today's writer, so they need not be those a fresh run gives: steps know defaults and no sky.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from survey_mc.errors import DamagedStore
from survey_mc.lock_form import lock_text, with_digest
from survey_mc.store.files import write_whole
from survey_mc.store.layout import RunLayout
from survey_mc.store.lock import run_lock
from survey_mc.store.lock_file import read_lock
from survey_mc.store.manifest import REMEDY, Manifest, Record
from survey_mc.store.parquet import write_piece
from survey_mc.store.replacement import finish_replacements, replace_piece, waiting_path
from survey_mc.store.stored_rows import stored_table
from survey_mc.store.upgrades import is_present


@dataclass(frozen=True, slots=True)
class Migration:
    """What was done. files: stored files. rewritten: those that were of an older version. lock: whether it was one."""

    files: int
    rewritten: int
    lock: bool


def migrate_run(run_dir: Path | str, on_file: Callable[[str], None] = lambda path: None) -> Migration:
    """Bring the lock file and all stored files of a run directory to the present version; no row and no value is lost.

    on_file is called before each file that is rewritten. Raises `RunLocked`, `DamagedStore` for what is not as it was
    written, `BadInput` for what a later version wrote.
    """
    layout = RunLayout(Path(run_dir).absolute())
    read_lock(layout.lock_file)
    with run_lock(layout):
        lock = read_lock(layout.lock_file)
        manifest = Manifest(layout.manifest)
        if manifest.damaged_lines:
            raise DamagedStore(f"{layout.manifest}: has damaged lines; {REMEDY}")
        finish_replacements(layout, manifest)
        older = [record for record in manifest if not _is_of_today(layout, record)]
        for record in older:
            on_file(record.piece.path)
            _rewrite(layout, manifest, record)
        if layout.manifest.is_file():
            manifest.compact()
        text = lock_text(with_digest(lock)).encode()
        is_older = layout.lock_file.read_bytes() != text
        if is_older:
            write_whole(layout.lock_file, text)
    return Migration(len(manifest), len(older), is_older)


def _is_of_today(layout: RunLayout, record: Record) -> bool:
    return is_present(record.piece.family.table, record.schema_version, str(layout.root / record.piece.path))


def _rewrite(layout: RunLayout, manifest: Manifest, record: Record) -> None:
    data = stored_table(layout, record)
    replace_piece(layout, manifest, write_piece(layout, record.piece, data, waiting_path(layout, record.piece)))
