"""What stands for a published value: a statistic of our fields, a number of our code, or nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from survey_mc.paper.claims import Published
from survey_mc.paper.rows import StudyRows
from survey_mc.paper.views import View
from survey_mc.types import FloatArray

Sampling = Literal["single images", "groups of ten fields"]
Values = Callable[[StudyRows, View], FloatArray]


@dataclass(frozen=True, slots=True)
class Reading:
    """Another way to read the paper's words: the name a view carries, and a sentence."""

    name: str
    about: str


@dataclass(frozen=True, slots=True)
class Statistic:
    """A statistic of simulated fields. values: one for each image or each drawn group, NaN where there is none.

    about: what is computed, in words. meaning: the interval of values that stands for a word.
    """

    claim: str
    about: str
    sampling: Sampling
    values: Values
    view: View
    readings: tuple[Reading, ...] = ()
    meaning: Published | None = None


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another way to compute a number: a named option, a sentence and what it gives."""

    name: str
    about: str
    values: Callable[[], FloatArray]


@dataclass(frozen=True, slots=True)
class Computed:
    """A number of our code: one value, a constant, or values drawn by it."""

    claim: str
    about: str
    values: Callable[[], FloatArray]
    alternatives: tuple[Alternative, ...] = ()


@dataclass(frozen=True, slots=True)
class NotCompared:
    """A claim that nothing of ours can decide, and why."""

    claim: str
    reason: str


Evidence = Statistic | Computed | NotCompared


def within(text: str, lower: float, upper: float) -> Published:
    """The interval that is taken to be the meaning of a word."""
    return Published(text, "word", (lower + upper) / 2.0, lower, upper)
