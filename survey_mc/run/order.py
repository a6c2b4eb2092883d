"""What a worker is asked to do, and the crumbs it gives back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.store import Record

if TYPE_CHECKING:
    from survey_mc.campaign import Campaign

Cause = Literal["exception", "memory", "timeout", "crash"]
CAUSES: dict[Cause, str] = {
    "exception": "the procedure raised an exception",
    "memory": "it asked for more memory than a worker may have",
    "timeout": "it took longer than a field may take",
    "crash": "its process died",
}


@dataclass(frozen=True, slots=True)
class Suspect:
    """A place at which a process died in an earlier run: to be tried in a process of its own.

    label: method, empty for drawing. timed_out: it is known to take too long and is not tried at all.
    """

    realisation: int
    label: str
    timed_out: bool
    trace: str


@dataclass(frozen=True, slots=True)
class Order:
    """Work on realisations start … stop − 1 of a cell.

    truth: whether their truth is still to be stored. detect, match: labels of the methods that still have to run, or
    only to be matched. stored: files with the detections of the methods that only have to be matched. suspects: what
    earlier runs died at. versions: libraries that the worker must have, empty if nobody asks.
    """

    campaign: Campaign
    root: Path
    cell_index: int
    start: int
    stop: int
    truth: bool
    detect: tuple[str, ...]
    match: tuple[str, ...]
    stored: dict[str, tuple[Record, ...]] = field(default_factory=dict)
    limits: FieldLimits = field(default_factory=FieldLimits)
    suspects: tuple[Suspect, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def n_fields(self) -> int:
        return self.stop - self.start

    def only(self, realisation: int) -> Order:
        """The part of this order for one field."""
        return replace(self, start=realisation, stop=realisation + 1, suspects=())

    def without(self, label: str) -> Order:
        """This order without a method."""
        return replace(
            self,
            detect=tuple(name for name in self.detect if name != label),
            match=tuple(name for name in self.match if name != label),
        )


@dataclass(frozen=True, slots=True)
class Failure:
    """A stage that could not be done on one field; method is empty when the field could not be drawn."""

    realisation: int
    method: str
    stage: str
    cause: Cause
    error: str
    trace: str


@dataclass(slots=True)
class Cost:
    """Seconds spent in a stage, summed over fields."""

    fields: int = 0
    cpu_s: float = 0.0
    wall_s: float = 0.0

    def add(self, fields: int, cpu_s: float, wall_s: float) -> None:
        self.fields += fields
        self.cpu_s += cpu_s
        self.wall_s += wall_s


@dataclass(slots=True)
class Outcome:
    """Crumbs of a finished order: what was committed, what failed, what was skipped, what it cost."""

    records: list[Record] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    skips: list[tuple[int, str, str]] = field(default_factory=list)
    costs: dict[tuple[str, str], Cost] = field(default_factory=dict)
    peak_mb: float = 0.0
    host: str = ""
    pid: int = 0

    def absorb(self, other: Outcome) -> None:
        """Add what a part of the same order gave."""
        self.records.extend(other.records)
        self.failures.extend(other.failures)
        self.skips.extend(other.skips)
        for place, cost in other.costs.items():
            self.costs.setdefault(place, Cost()).add(cost.fields, cost.cpu_s, cost.wall_s)
