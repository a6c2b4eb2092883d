"""What lies in the run's own folders and belongs to nothing.

Idea     every file there has a place it was made for: in the manifest, in the list of the report, among the inputs, or
         the name of a journal. Killed runs leave temporary files and stored files that never entered the manifest; all
         else is somebody else's. Nothing is opened or followed.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from survey_mc.store.damage import Damage, Kind
from survey_mc.store.files import entries, is_plain, is_temporary_name
from survey_mc.store.layout import OWN_FOLDERS, STORE_FOLDER, Piece, RunLayout, is_journal_name
from survey_mc.store.manifest import Manifest
from survey_mc.store.replacement import is_replacement

_COMMITTED_NAME = re.compile(r"[0-9a-f]{32}\.parquet")
_BESIDE_JOURNALS = ("cpu_seconds.csv", "cpu_seconds.parquet")  # made by the report
STRANGER = "is not a file that the run made"
FROM_KILLED = "is what a killed run left"


def is_committed_name(name: str) -> bool:
    """Whether a temporary file of that name is one that was to be committed."""
    return _COMMITTED_NAME.fullmatch(name) is not None


def unfinished_writes(layout: RunLayout) -> Iterator[Path]:
    """What a killed process was writing beside the store: temporary files, by their names."""
    own = {path.name for path in (layout.campaign, layout.lock_file, layout.manifest, layout.digests)}
    for entry in sorted(layout.root.glob(".*")):
        if is_plain(entry) and is_temporary_name(entry.name) and entry.name[1:].rpartition(".")[0] in own:
            yield entry
    for name in OWN_FOLDERS:
        if name != STORE_FOLDER:
            yield from (path for path in entries(layout.root / name) if is_temporary_name(path.name))


def strays(
    layout: RunLayout,
    manifest: Manifest,
    inputs: Collection[str] | None = None,
    digests: Mapping[str, str] | None = None,
    folders: Iterable[str] = OWN_FOLDERS,
) -> Iterator[Damage]:
    """Files that nobody knows, and what killed runs left.

    inputs: paths of the campaign's files, None if nobody knows them. digests: what the report made, None if unknown.
    """
    for name in folders:
        # The folder itself may be a link: somebody keeps a large store on another disk.
        for path in entries(layout.root / name):
            relative = path.relative_to(layout.root).as_posix()
            damage = _stray(relative, path, layout, manifest, inputs, digests)
            if damage is not None:
                yield damage


def _stray(
    relative: str,
    path: Path,
    layout: RunLayout,
    manifest: Manifest,
    inputs: Collection[str] | None,
    digests: Mapping[str, str] | None,
) -> Damage | None:
    folder, _, rest = relative.partition("/")
    leftover: Kind = "leftover" if is_plain(path) else "extra"
    if folder == STORE_FOLDER:
        piece = Piece.from_path(relative)
        if piece is not None:
            return None if piece in manifest else Damage("leftover", relative, "is not in the manifest")
        is_ours = path.parent == layout.temporary and (is_committed_name(path.name) or is_replacement(path))
        return Damage(leftover, relative, FROM_KILLED) if is_ours else Damage("extra", relative, STRANGER)
    if folder == "attempts":
        return Damage(leftover, relative, FROM_KILLED)
    if is_temporary_name(path.name):
        return None  # named as an unfinished write
    if folder == "inputs":
        is_known = inputs is None or rest in inputs
        return None if is_known else Damage(leftover, relative, "is a file that the campaign does not name (any more)")
    if folder == "runs":
        is_known = is_journal_name(rest) or rest in _BESIDE_JOURNALS
    else:
        is_known = not digests or relative in digests
    return None if is_known else Damage("extra", relative, STRANGER)
