"""A claim: one sentence that must be true of every procedure, and the function that tries it.

Idea     a claim returns when it holds and raises `Violation` with what was expected and what was found. It raises
         `NotApplicable` where the procedure does not offer what the claim is about.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass

from survey_mc.testing.case import Case


class Violation(AssertionError):
    """A claim that does not hold: what was expected, what was found."""

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(f"expected {expected}; found {found}")


class NotApplicable(Exception):
    """A claim about something the procedure does not offer."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A named claim; `about` is the sentence, `check` tries it on a case."""

    name: str
    about: str
    check: Callable[[Case], None]

    def __str__(self) -> str:
        return self.name

    def __call__(self, case: Case) -> None:
        self.check(case)


def claims_of(*checks: Callable[[Case], None]) -> tuple[Claim, ...]:
    """Claims from functions: the name of the function, and its docstring as the sentence."""
    return tuple(Claim(check.__name__, " ".join((inspect.getdoc(check) or "").split()), check) for check in checks)


def expect(holds: bool, expected: str, found: object) -> None:
    """Raise `Violation` unless it holds."""
    if not holds:
        raise Violation(expected, str(found))
