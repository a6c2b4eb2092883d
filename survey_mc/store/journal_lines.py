"""Lines of a journal: written with a checksum, read without those that are damaged.

Idea     a journal is a log: a line that was damaged is left out and all others are used. Only whole lines count; one
         without its end is what a process was writing when it died.
Limits   journals of the first versions have no checksums; in those only what is no JSON, or lacks what a reader needs,
         is seen. A journal that was cut at the end of a line looks like that of a killed run.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from survey_mc.store.files import is_plain, write_whole
from survey_mc.store.sealed_text import is_sealed, opened, seal

# What the readers of an event use; a line without checksum may lack it or have something else in its place.
_NEEDED: Mapping[str, Mapping[str, type]] = {
    "start": {"at": str, "executor": str, "workers": int, "fields": int},
    "task": {"at": str, "cell": str, "start": int, "stop": int, "costs": list},
    "failure": {"cell": str, "realisation": int, "method": str, "key": str, "stage": str, "error": str, "replay": str},
    "skip": {"cell": str, "realisation": int, "method": str, "reason": str},
    "quarantine": {"at": str, "cell": str, "start": int, "stop": int, "keys": list, "error": str, "replay": str},
    "finish": {"at": str},
}
_COST: Mapping[str, type] = {"method": str, "stage": str, "fields": int, "cpu_s": float, "wall_s": float}


def seal_line(content: Mapping[str, Any]) -> str:
    """A line of a journal: the content as JSON in its own order, its checksum, and the end of the line."""
    return seal(json.dumps(content)) + "\n"


def read_lines(path: Path) -> Iterator[tuple[int, dict[str, Any] | None]]:
    """Number and content of each line of a journal, None for a damaged one; a torn last line is left out.

    A path that is no regular file has no lines.
    """
    if not is_plain(path):
        return
    with path.open("rb") as handle:
        has_seals = any(is_sealed(line[:-1]) for line in handle)
        handle.seek(0)
        for number, line in enumerate(handle, start=1):
            if line.endswith(b"\n"):
                yield number, _content(line[:-1], has_seals)


def torn_end(path: Path) -> tuple[int, bool] | None:
    """Number of a last line without its end, and whether that is damage: no crash leaves a line whole but for another
    end. None if there is none."""
    with path.open("rb") as handle:
        lines = deque(enumerate(handle, start=1), maxlen=1)
    number, last = lines.pop() if lines else (0, b"\n")
    return None if last.endswith(b"\n") else (number, opened(last[:-1]) is not None)


def drop_damaged_lines(path: Path) -> None:
    """Rewrite a journal without its damaged lines and its torn end; the others keep their bytes."""
    sound = {number for number, content in read_lines(path) if content is not None}
    with path.open("rb") as handle:
        kept = b"".join(line for number, line in enumerate(handle, start=1) if number in sound)
    write_whole(path, kept)


def _content(line: bytes, has_seals: bool) -> dict[str, Any] | None:
    text = opened(line) if has_seals else line
    if text is None:
        return None
    try:
        content = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) and _is_usable(content) else None


def _is_usable(content: dict[str, Any]) -> bool:
    needed = _NEEDED.get(str(content.get("event")), {})
    try:
        if "at" in needed:
            datetime.fromisoformat(content["at"])
    except (KeyError, TypeError, ValueError):
        return False
    costs = content["costs"] if isinstance(content.get("costs"), list) else []
    return _has(content, needed) and all(isinstance(cost, dict) and _has(cost, _COST) for cost in costs)


def _has(content: Mapping[str, Any], needed: Mapping[str, type]) -> bool:
    """Whether all that is needed is there; whole numbers may stand for fractions."""
    return all(isinstance(content.get(name), (int, float) if kind is float else kind) for name, kind in needed.items())
