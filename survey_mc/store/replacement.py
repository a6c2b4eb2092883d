"""A stored file in another form takes the place of the present one, in steps that may end at any time.

Idea     the new file waits among the temporary ones under the name of its piece; its record enters the manifest; it is
         renamed. Whoever opens the run for writing next finishes what was begun: a waiting file that the manifest
         counts is moved into its place, any other is removed.
Limits   between the last two steps a reader finds the old file under the new record and calls it changed.
"""

from __future__ import annotations

import re
from pathlib import Path

from survey_mc.store.files import entries, file_sha256, fsync, is_plain
from survey_mc.store.layout import Piece, RunLayout
from survey_mc.store.manifest import Manifest, Record

_SUFFIX = ".replacement"
_NAME = re.compile(rf"[a-z]+-[0-9a-f]{{32}}-[0-9]{{7,8}}-[0-9]{{7,8}}{re.escape(_SUFFIX)}")


def waiting_path(layout: RunLayout, piece: Piece) -> Path:
    """Where the new file of a piece waits."""
    name = f"{piece.family.table}-{piece.family.key}-{piece.start:07d}-{piece.stop:07d}{_SUFFIX}"
    return layout.temporary / name


def is_replacement(path: Path) -> bool:
    """Whether a file has the name of a waiting one."""
    return _NAME.fullmatch(path.name) is not None


def replace_piece(layout: RunLayout, manifest: Manifest, record: Record) -> None:
    """Let the waiting file of a record take its place. To be called by the holder of the run lock."""
    manifest.add([record])
    _put_in_place(layout, record)


def finish_replacements(layout: RunLayout, manifest: Manifest) -> None:
    """Finish or take back what a killed process had begun. To be called by the holder of the run lock."""
    for path in list(entries(layout.temporary)):
        if is_replacement(path):
            record = _record_of(path, layout, manifest)
            if record is not None and is_plain(path) and file_sha256(path) == record.sha256:
                _put_in_place(layout, record)
            else:
                path.unlink()


def _put_in_place(layout: RunLayout, record: Record) -> None:
    final = layout.root / record.piece.path
    waiting_path(layout, record.piece).replace(final)
    fsync(final.parent)


def _record_of(path: Path, layout: RunLayout, manifest: Manifest) -> Record | None:
    table, key, start, stop = path.name.removesuffix(_SUFFIX).split("-")
    piece = Piece.from_path(f"{layout.store.relative_to(layout.root).as_posix()}/{table}/{key}/{start}-{stop}.parquet")
    return None if piece is None else manifest.record(piece)
