"""The published facts: 187 numbers and words of Valtchanov, Pierre & Gastaud 2001, each with its place.

Idea     a fact is an interval of values that the printed text allows: a number is known to half of its last printed
         digit, a range and a bound as they stand, a number of things exactly. Words get their interval from the
         statistic that stands for them, because only there it is said what "significant" is taken to mean.
Source   paper, Tabs. 1 to 9 and Sects. 4 to 8; facts and notes in our own words.
Limits   an integer that ends in zeros and does not number things ("about 20 counts") is taken to be rounded to its
         last other digit.
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

from survey_mc.errors import BadInput

CLAIMS_FILE = "claims.csv"
THINGS = ("sources", "detections", "pairs")  # units of whole numbers, printed exactly

POWER_OF_TEN_BELOW = 0.1  # of the half width

ValueKind = Literal["number", "range", "bound", "fraction", "word"]

_NUMBER = r"[0-9]+(?:\.[0-9]+)?(?:e[+-]?[0-9]+)?"
_SHAPES: tuple[tuple[ValueKind, re.Pattern[str]], ...] = (
    ("number", re.compile(rf"({_NUMBER})")),
    ("range", re.compile(rf"({_NUMBER})-({_NUMBER})")),
    ("bound", re.compile(rf"([<>])({_NUMBER})")),
    ("fraction", re.compile(r"([0-9]+) of ([0-9]+)")),
)


@dataclass(frozen=True, slots=True)
class Published:
    """What was printed and the closed interval of values it allows; NaN ends for a word.

    number: the value itself, the middle of a range, the end of a bound, the numerator of a fraction. of: the
    denominator of a fraction, else NaN.
    """

    text: str
    kind: ValueKind
    number: float
    lower: float
    upper: float
    of: float = math.nan


@dataclass(frozen=True, slots=True)
class Claim:
    """One published fact. where: table or section; method: procedures, as registered names; condition: in words."""

    id: str
    where: str
    quantity: str
    method: str
    condition: str
    published: Published
    unit: str
    note: str


@cache
def load_claims() -> tuple[Claim, ...]:
    """All published facts, in the order of the paper."""
    text = files("survey_mc.paper").joinpath(CLAIMS_FILE).read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return tuple(
        Claim(
            id=row["id"],
            where=row["where"],
            quantity=row["quantity"],
            method=row["method"],
            condition=row["condition"],
            published=parse_value(row["value"], row["unit"]),
            unit=row["unit"],
            note=row["note"],
        )
        for row in rows
    )


def parse_value(text: str, unit: str = "") -> Published:
    """The interval that a printed value allows; anything that is no number is a word. Empty text is an error."""
    if not text.strip():
        raise BadInput(CLAIMS_FILE, "a published value is missing")
    for kind, shape in _SHAPES:
        found = shape.fullmatch(text)
        if found:
            return _published(text, kind, found.groups(), unit)
    return Published(text, "word", math.nan, math.nan, math.nan)


def _published(text: str, kind: ValueKind, parts: tuple[str, ...], unit: str) -> Published:
    if kind == "bound":
        end = float(parts[1])
        lower, upper = (-math.inf, end) if parts[0] == "<" else (end, math.inf)
        return Published(text, kind, end, lower, upper)
    if kind == "fraction":
        n, of = (float(part) for part in parts)
        return Published(text, kind, n, n, n, of)
    ends = [float(part) for part in parts]
    below = half_width(parts[0], unit) * (POWER_OF_TEN_BELOW if _is_power_of_ten(parts[0]) else 1.0)
    return Published(text, kind, sum(ends) / len(ends), ends[0] - below, ends[-1] + half_width(parts[-1], unit))


def _is_power_of_ten(text: str) -> bool:
    """Whether the only digit printed is a 1: from below, the next printable number is 0.9 and not 0."""
    return text.partition("e")[0].replace(".", "").strip("0") == "1"


def half_width(text: str, unit: str = "") -> float:
    """Half of the last printed digit of a number; 0 for a whole number of things."""
    mantissa, _, exponent = text.partition("e")
    whole, point, decimals = mantissa.partition(".")
    if point or exponent:
        return 0.5 * 10.0 ** (int(exponent or 0) - len(decimals))
    if unit in THINGS:
        return 0.0
    return 0.5 * 10.0 ** (len(whole) - len(whole.rstrip("0")))


def published_number(claim_id: str) -> float | None:
    """The number of a claim; None if there is none of that id."""
    return next((claim.published.number for claim in load_claims() if claim.id == claim_id), None)


def printed_number(claim_id: str) -> float:
    """The number of a claim that there is; `KeyError` for an unknown id."""
    number = published_number(claim_id)
    if number is None:
        raise KeyError(f"{CLAIMS_FILE} has no claim {claim_id!r}")
    return number
