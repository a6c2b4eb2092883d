"""SHA-256 of what the report made: tables, CPU seconds, page and figures.

Idea     the list has the form that `sha256sum -c tables.sha256` reads, sorted by path. It is removed before the report
         writes anything and written after everything else, so that there is none while they do not belong together.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from survey_mc.store.damage import Damage
from survey_mc.store.files import entries, file_sha256, is_plain, what_it_is, write_whole
from survey_mc.store.layout import RunLayout

REMEDY = "`survey-mc report` makes it again"
_LINE = re.compile(r"([0-9a-f]{64})  ((?:tables|report|runs)/[^/\\\n]+)\n")


def forget_digests(root: Path) -> None:
    """Remove the list: what it says is about to change."""
    RunLayout(root).digests.unlink(missing_ok=True)


def write_digests(root: Path, paths: Iterable[Path]) -> None:
    """Write the list of these files, which lie below root."""
    names = sorted(path.relative_to(root).as_posix() for path in paths)
    text = "".join(f"{file_sha256(root / name)}  {name}\n" for name in names)
    write_whole(RunLayout(root).digests, text.encode())


def read_digests(layout: RunLayout) -> dict[str, str] | None:
    """SHA-256 by path relative to the run directory; empty if there is no list, None if it is damaged."""
    if not what_it_is(layout.digests):
        return {}
    if not is_plain(layout.digests):
        return None
    digests: dict[str, str] = {}
    last = ""
    with layout.digests.open("rb") as handle:
        for line in handle:
            found = _LINE.fullmatch(line.decode("utf-8", errors="replace"))
            if found is None or found[2] <= last:
                return None
            last = found[2]
            digests[last] = found[1]
    return digests or None


def table_damages(layout: RunLayout, *, required: bool) -> Iterator[Damage]:
    """What of the report is not as it was made. required: tables without a list are damaged, too."""
    digests = read_digests(layout)
    if digests is None:
        yield Damage("table", layout.digests.name, f"is damaged; {REMEDY}")
        for folder in (layout.tables, layout.report):
            for path in entries(folder):
                name = path.relative_to(layout.root).as_posix()
                yield Damage("table", name, "may have changed: the list that has its SHA-256 is damaged")
        return
    if required and not digests and any(True for folder in (layout.tables, layout.report) for _ in entries(folder)):
        yield Damage("table", layout.digests.name, f"is missing, or the report was not finished; {REMEDY}")
    for name, digest in digests.items():
        path = layout.root / name
        if not is_plain(path):
            what = what_it_is(path)
            yield Damage("table", name, f"is {what}, not a file" if what else f"is missing; {REMEDY}")
        elif file_sha256(path) != digest:
            yield Damage("table", name, f"has another SHA-256 than when it was made; {REMEDY}")
