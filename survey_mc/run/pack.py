"""Join the parts of a shard into its one file.

Idea     done by the process that holds the run lock, after the parts are in the manifest: write the whole, add it to
         the manifest, drop the parts, then delete them. A crash in between leaves either the parts or the whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import pyarrow as pa

from survey_mc.errors import DamagedStore
from survey_mc.run.work import Range
from survey_mc.store import Family, Manifest, Piece, Record, RunLayout
from survey_mc.store.files import entries, what_it_is
from survey_mc.store.manifest import REMEDY
from survey_mc.store.parquet import write_piece
from survey_mc.store.replacement import finish_replacements
from survey_mc.store.stored_rows import stored_table
from survey_mc.store.strays import is_committed_name, unfinished_writes


def pack_shard(layout: RunLayout, manifest: Manifest, family: Family, shard: Range, *, only_whole: bool) -> None:
    """Join adjacent pieces of a family inside a shard into one file.

    only_whole: join only if the shard is complete (while a run goes on, more parts may still come).
    """
    for run in _adjacent(manifest.covering(family, *shard)):
        start, stop = run[0].piece.start, run[-1].piece.stop
        inside = shard[0] <= start and stop <= shard[1]
        if len(run) > 1 and inside and ((start, stop) == shard or not only_whole):
            _join(layout, manifest, family, run)


def _join(layout: RunLayout, manifest: Manifest, family: Family, parts: list[Record]) -> None:
    whole = Piece(family, parts[0].piece.start, parts[-1].piece.stop)
    # Parts of an older version are joined as what they are today.
    data = pa.concat_tables([stored_table(layout, part) for part in parts]).combine_chunks()
    manifest.add([write_piece(layout, whole, data, layout.root / whole.path)])
    manifest.drop(part.piece for part in parts)
    for part in parts:
        (layout.root / part.piece.path).unlink(missing_ok=True)


def _adjacent(parts: Iterable[Record]) -> Iterator[list[Record]]:
    """Groups of files in which each begins where the one before ends."""
    run: list[Record] = []
    for part in parts:
        if run and part.piece.start != run[-1].piece.stop:
            yield run
            run = []
        run.append(part)
    if run:
        yield run


def drop_superseded(layout: RunLayout, manifest: Manifest) -> None:
    """Remove the parts that lie inside a larger file: of a killed packing, or made again beside a whole one."""
    gone = manifest.superseded()
    manifest.drop(gone)
    for piece in gone:
        (layout.root / piece.path).unlink(missing_ok=True)


def sweep(layout: RunLayout, manifest: Manifest) -> None:
    """Remove what a killed run left behind: temporary files, packed parts, files that never entered the manifest.

    Only names that the store itself gives are touched. To be called by the holder of the run lock.
    """
    finish_replacements(layout, manifest)
    for path in list(entries(layout.temporary)):
        if is_committed_name(path.name):
            path.unlink(missing_ok=True)
    for path in list(unfinished_writes(layout)):
        path.unlink(missing_ok=True)
    drop_superseded(layout, manifest)
    for relative in list(layout.piece_files()):
        piece = Piece.from_path(relative)
        if piece is not None and piece not in manifest:
            (layout.root / relative).unlink(missing_ok=True)
        elif piece is None and what_it_is(layout.root / relative) == "a link":
            raise DamagedStore(
                f"{layout.root / relative}: is a link, and a run writes nothing outside its directory; {REMEDY}"
            )
