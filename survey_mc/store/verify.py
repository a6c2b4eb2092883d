"""Is every file of a run what the manifest says it is?

Idea     SHA-256 sees every flipped bit; on top, the file must open, carry its declared schema and have its rows. Files
         in the store that no manifest line names are reported too: as left over by a killed run (no reader looks at
         them, and the next run removes them) when they have a name that the store gives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import pyarrow as pa
import pyarrow.parquet as pq

from survey_mc.store.layout import Piece, RunLayout
from survey_mc.store.manifest import Manifest, Record
from survey_mc.store.parquet import file_sha256

Kind = Literal["missing", "changed", "unreadable", "schema", "rows", "extra", "manifest", "leftover", "campaign"]


@dataclass(frozen=True, slots=True)
class Damage:
    """One thing that is wrong: kind, path relative to the run directory, and what was expected."""

    kind: Kind
    path: str
    about: str

    @property
    def piece(self) -> Piece | None:
        return Piece.from_path(self.path)


def verify_store(
    layout: RunLayout, manifest: Manifest, on_file: Callable[[str], None] = lambda path: None
) -> Iterator[Damage]:
    """Check every file of the manifest and name every file that is not in it. on_file is called before each file."""
    if not layout.manifest.is_file():
        yield Damage("manifest", layout.manifest.name, "is missing")
    for number in manifest.unreadable_lines:
        yield Damage("manifest", layout.manifest.name, f"line {number} cannot be read")
    known = set()
    for record in manifest:
        known.add(record.piece.path)
        on_file(record.piece.path)
        damage = _check_record(layout, record)
        if damage is not None:
            yield damage
    for path in layout.piece_files():
        if path not in known:
            kind: Kind = "extra" if Piece.from_path(path) is None else "leftover"
            yield Damage(kind, path, "is not in the manifest")


def _check_record(layout: RunLayout, record: Record) -> Damage | None:
    path = layout.root / record.piece.path
    if not path.is_file():
        return Damage("missing", record.piece.path, "is in the manifest and not on disk")
    if path.is_symlink():
        return Damage("changed", record.piece.path, "is a link, not a file")
    size = path.stat().st_size
    if size != record.size_bytes:
        return Damage("changed", record.piece.path, f"has {size} bytes, {record.size_bytes} were written")
    if file_sha256(path) != record.sha256:
        return Damage("changed", record.piece.path, "has another SHA-256 than when it was written")
    try:
        data = pq.read_table(path, page_checksum_verification=True, use_threads=False, partitioning=None)
    except (OSError, pa.ArrowException) as problem:
        return Damage("unreadable", record.piece.path, f"cannot be read: {str(problem)[:120]}")
    meta = data.schema.metadata or {}
    if meta.get(b"table", b"").decode() != record.piece.family.table:
        return Damage("schema", record.piece.path, f"holds table {meta.get(b'table', b'?').decode()!r}")
    if meta.get(b"schema_version", b"").decode() != str(record.schema_version):
        return Damage("schema", record.piece.path, f"has schema version {meta.get(b'schema_version', b'?').decode()!r}")
    if data.num_rows != record.rows:
        return Damage("rows", record.piece.path, f"has {data.num_rows} rows, {record.rows} were written")
    return None
