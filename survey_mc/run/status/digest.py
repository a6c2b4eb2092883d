"""What the journals of a run say, in one pass: costs, open failures and skips, and how the latest start gets on.

Idea     only sums, and the latest word on each field and method that is missing, stay in memory.
Limits   times are those of the clock of the driver's machine.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from survey_mc.run.order import Cost
from survey_mc.store import CellRecord

Entry = Mapping[str, Any]
Place = tuple[str, str, int]  # cell, method, realisation


@dataclass(slots=True)
class LatestStart:
    """The latest start of a run: fields it set out to do and did, when it began and last wrote (ISO 8601).

    is_over: it came to its end; one that was killed did not.
    """

    begun_at: str
    executor: str
    workers: int
    fields: int
    latest_at: str
    done: int = 0
    is_over: bool = False

    @property
    def elapsed_s(self) -> float:
        """From the beginning to the latest entry."""
        return seconds_between(self.begun_at, self.latest_at)

    @property
    def fields_per_s(self) -> float | None:
        """Rate since the beginning; None before anything is done."""
        return self.done / self.elapsed_s if self.done and self.elapsed_s > 0 else None

    def left_s(self, now: datetime) -> float | None:
        """Seconds to the end at that rate."""
        if self.fields_per_s is None:
            return None
        since_s = seconds_between(self.latest_at, now.isoformat())
        return max(0.0, (self.fields - self.done) / self.fields_per_s - since_s)


def seconds_between(first: str, then: str) -> float:
    """Seconds from one time to a later one; 0 if a clock was put back between them."""
    return max(0.0, (datetime.fromisoformat(then) - datetime.fromisoformat(first)).total_seconds())


@dataclass(slots=True)
class Digest:
    """costs: by method label (empty: drawing) and stage. open: the latest failure or skip at each place."""

    costs: dict[tuple[str, str], Cost] = field(default_factory=dict)
    open: dict[Place, dict[str, Any]] = field(default_factory=dict)
    latest: LatestStart | None = None


def digest(entries: Iterable[Entry], cells: Iterable[CellRecord]) -> Digest:
    """Read the journals of a run, oldest first. What concerns other cells or parameters than those given is left out
    of `open`, and counts among the costs."""
    known = {cell.label: cell for cell in cells}
    found = Digest()
    costs: defaultdict[tuple[str, str], Cost] = defaultdict(Cost)
    for entry in entries:
        event = entry.get("event")
        if event == "task":
            for cost in entry["costs"]:
                costs[cost["method"], cost["stage"]].add(cost["fields"], cost["cpu_s"], cost["wall_s"])
        elif event in ("failure", "quarantine", "skip") and entry.get("cell") in known:
            for place, gap in _gaps(entry, known[entry["cell"]]):
                found.open.pop(place, None)  # so that the order is that of the latest word
                found.open[place] = gap
        found.latest = _followed(found.latest, entry)
    found.costs.update(costs)
    return found


def _followed(latest: LatestStart | None, entry: Entry) -> LatestStart | None:
    event = entry.get("event")
    if event == "start":
        return LatestStart(entry["at"], entry["executor"], int(entry["workers"]), int(entry["fields"]), entry["at"])
    if latest is not None and event in ("task", "quarantine", "finish"):
        latest.latest_at = entry["at"]
        if event == "finish":
            latest.is_over = True
        else:
            latest.done += int(entry["stop"]) - int(entry["start"])
    return latest


def _labels(cell: CellRecord, key: str | None) -> list[str]:
    """The methods of these parameters, whatever they were called when the journal was written."""
    return [label for label, its_key in cell.detect_keys.items() if its_key == key]


def _gaps(entry: Entry, cell: CellRecord) -> Iterator[tuple[Place, dict[str, Any]]]:
    """Failures and skips of single fields and methods: a quarantined task is one for each of its fields and methods."""
    label, event = cell.label, entry["event"]
    if event == "skip":
        # journals of the first versions do not say of which parameters a skip is
        key = entry.get("key", cell.detect_keys.get(entry["method"]))
        for method in _labels(cell, key):
            yield (label, method, int(entry["realisation"])), {"reason": entry["reason"]}
        return
    shared = {
        "cell": label,
        "cause": entry.get("cause", "exception"),
        "error": entry["error"],
        "replay": entry["replay"],
        "stage": entry.get("stage", "task"),
    }
    if event == "quarantine":
        methods = [method for method, key in cell.detect_keys.items() if key in entry["keys"]]
        realisations = range(int(entry["start"]), int(entry["stop"]))
    elif entry["method"]:
        methods = _labels(cell, entry["key"])
        realisations = range(int(entry["realisation"]), int(entry["realisation"]) + 1)
    else:
        methods = list(cell.detect_keys) if entry["key"] == cell.field_key else []
        realisations = range(int(entry["realisation"]), int(entry["realisation"]) + 1)
    for method in methods:
        for realisation in realisations:
            yield (label, method, realisation), {**shared, "method": method, "realisation": realisation}
