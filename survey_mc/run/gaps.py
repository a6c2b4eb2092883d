"""Fields that a method leaves open: those it failed on and those it skipped, as the journals tell.

Idea     both are left alone when a run is started again, until they are asked for: a failure costs as much the second
         time, and a skip is an answer. They hang on content keys, so other parameters start with a clean sheet.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

# Realisations by the field key (drawing) or the detect key (a method).
Realisations = Mapping[str, set[int]]


@dataclass(slots=True)
class Gaps:
    """failed, skipped: realisations by key."""

    failed: dict[str, set[int]] = field(default_factory=dict)
    skipped: dict[str, set[int]] = field(default_factory=dict)

    def fail(self, key: str, realisations: Iterable[int]) -> None:
        self.failed.setdefault(key, set()).update(realisations)

    def skip(self, key: str, realisation: int) -> None:
        self.skipped.setdefault(key, set()).add(realisation)

    @property
    def left_alone(self) -> Realisations:
        """Both together, as they are now."""
        keys = self.failed.keys() | self.skipped.keys()
        return {key: self.failed.get(key, set()) | self.skipped.get(key, set()) for key in keys}


def known_gaps(entries: Iterable[dict[str, Any]]) -> Gaps:
    """What the journals of earlier runs wrote down."""
    gaps = Gaps()
    for entry in entries:
        event = entry.get("event")
        if event == "skip" and entry.get("key"):
            gaps.skip(entry["key"], int(entry["realisation"]))
        elif event in ("failure", "quarantine"):
            for key, realisations in _failed(entry):
                gaps.fail(key, realisations)
    return gaps


def _failed(entry: dict[str, Any]) -> Iterator[tuple[str, Iterable[int]]]:
    if entry["event"] == "quarantine":
        for key in entry["keys"]:
            yield key, range(int(entry["start"]), int(entry["stop"]))
    elif entry.get("key"):
        yield entry["key"], (int(entry["realisation"]),)
