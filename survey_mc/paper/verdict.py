"""The verdict on one published value: could it have been one of ours?

Idea     our values are what the same statistic gives on our own fields, one for each image or for each group of ten
         fields. If the paper's fields were like ours, its value would be one more of them; a rank among n others
         beyond the outer 2.5 % on either side is then rare.
             p_low  = (1 + number of ours ≤ upper end of what is printed) / (n + 1)
             p_high = (1 + number of ours ≥ lower end of what is printed) / (n + 1)
         `reproduced` if both are above 0.025, `differs` otherwise: a true model differs in at most 5 % of the rows of
         single images. Drawn groups are not independent values: there it differs in about 7 % with 50 fields.
Source   Monte-Carlo test: Davison & Hinkley 1997, "Bootstrap Methods and their Application", Sect. 4.2.
Limits   with fewer than 39 values neither p can fall to 0.025: `not comparable`, and so are groups drawn from fewer
         fields (from ten of them a true model would differ in 12 to 24 % of the rows). A range or bound is reproduced
         if some of ours lie on its side: it is a weaker claim than a number. Of a hundred drawn rows some five differ
         by chance alone, and they have no cause. A constant has one value, computed and not drawn: `reproduced` if it
         is within what the printed digits allow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from survey_mc.paper.claims import Published
from survey_mc.paper.study import LEAST_FIELDS
from survey_mc.types import FloatArray

Verdict = Literal["reproduced", "differs", "not comparable"]

TAIL = 0.025
LEAST_VALUES = LEAST_FIELDS  # 1 / (39 + 1) = TAIL
ROUNDING = 1e-9  # of a constant, relative
CENTRAL_68 = (0.1587, 0.8413)
CENTRAL_95 = (0.025, 0.975)

SHORT_RULE = (
    f"reproduced if more than {100 * TAIL:g} % of our values are as low as the printed one and more than that as high "
    f"((k + 1)/(n + 1), the printed digits' rounding allowed for); differs otherwise; not comparable with fewer than "
    f"{LEAST_VALUES} values, or fields to draw groups from, or where no number decides. Constants: within the printed "
    "digits."
)
RULE = (
    "A published value is compared with the spread of the same statistic on our own fields: a number the paper has "
    "from one image with ours of single images, a number it has from ten fields with groups of ten, drawn from ours "
    "with replacement (each group from a resampled set of our fields, so that our limited number is in the spread). "
    "Never with a mean and its error.",
    "With n values of ours, p_low = (1 + number of ours at or below the published value) / (n + 1) and p_high "
    f"likewise above it. The value is reproduced if both are above {TAIL:g}; otherwise it differs. A model that is "
    f"true differs in at most {200 * TAIL:g} % of the rows of single images, and in about 7 % of those of groups drawn "
    "from 50 fields: of a hundred rows some five by chance, without any cause. Rows of one test share the paper's "
    f"image, so they are not independent. With fewer than {LEAST_VALUES} values neither p can be so small, and the row "
    f"is not comparable; nor is one of groups drawn from fewer than {LEAST_VALUES} fields, nor what no number of ours "
    "can decide, such as minutes on another machine.",
    "What is printed stands for an interval: half of the last printed digit to either side, nothing for a whole number "
    "of things, the range as printed for a range, one side for a bound. Such a weaker claim is reproduced if some of "
    "ours lie where it says. A constant of the simulator is reproduced if it is within the printed digits. Words have "
    "an interval that their statistic states: significant confusion is more than 10 % of the sources lost to "
    "neighbours, absent less than 5 %, marginal between; agreement is 10 % or 3σ, from ten times the flux on; numerous "
    "is a third of the detections; a cluster is not detected if nothing is within 20″.",
    "For a value that differs, every named option that can concern it is evaluated, one at a time, with the same "
    "statistic on the first fifty of the same fields. An option counts if it brings our median nearer to the published "
    "value by a third "
    "of the distance or more. It explains if the value is then reproduced, and explains in part if not; the nearest is "
    "named. It shows what suffices, not what happened in 2001.",
)


@dataclass(frozen=True, slots=True)
class Spread:
    """Our distribution of a statistic: finite values only in n; all numbers NaN for none."""

    n: int
    median: float
    lower_68: float
    upper_68: float
    lower_95: float
    upper_95: float


@dataclass(frozen=True, slots=True)
class Judgement:
    """A verdict with its reason. percentile: of the published value among ours (mid-rank), 0 to 100."""

    verdict: Verdict
    reason: str
    spread: Spread
    percentile: float = math.nan


def spread_of(values: FloatArray) -> Spread:
    """Median and central intervals; NaN (nothing to measure in an image) is left out, ±inf is a value."""
    known = np.sort(values[~np.isnan(values)])
    if not len(known):
        return Spread(0, *(math.nan,) * 5)
    ends = [_quantile(known, fraction) for fraction in (0.5, *CENTRAL_68, *CENTRAL_95)]
    return Spread(len(known), *ends)


def _quantile(ascending: FloatArray, fraction: float) -> float:
    """Linear between neighbours; no interpolation next to an infinite one."""
    place = fraction * (len(ascending) - 1)
    below = math.floor(place)
    low, high = float(ascending[below]), float(ascending[min(below + 1, len(ascending) - 1)])
    if math.isinf(low) or math.isinf(high):
        return low if place - below < 0.5 else high
    return low + (place - below) * (high - low)


def judge(published: Published, values: FloatArray, n_fields: int | None = None) -> Judgement:
    """Verdict on drawn values, (n,); NaN values are left out. n_fields: those that groups were drawn from, or None."""
    known = values[~np.isnan(values)]
    spread = spread_of(values)
    if math.isnan(published.lower):
        return Judgement("not comparable", f"no number stands for “{published.text}”", spread)
    percentile = _percentile(published, known)
    if len(known) < LEAST_VALUES:
        return Judgement("not comparable", _too_few(len(known), "values"), spread, percentile)
    if n_fields is not None and n_fields < LEAST_VALUES:
        return Judgement("not comparable", _too_few(n_fields, "fields"), spread, percentile)
    n_low, n_high = int(np.sum(known <= published.upper)), int(np.sum(known >= published.lower))
    chances = [(1 + n) / (len(known) + 1) for n in (n_low, n_high)]
    verdict: Verdict = "reproduced" if min(chances) > TAIL else "differs"
    whose = "of ours" if n_fields is None else f"groups drawn from {n_fields} fields"
    reason = f"{n_low} of {len(known)} {whose} as low, {n_high} as high"
    return Judgement(verdict, reason, spread, percentile)


def judge_constant(published: Published, value: float) -> Judgement:
    """Verdict on a number that is computed and not drawn."""
    slack = ROUNDING * abs(value)
    inside = published.lower - slack <= value <= published.upper + slack
    reason = f"{'within' if inside else 'beyond'} the printed digits"
    return Judgement("reproduced" if inside else "differs", reason, spread_of(np.array([value])))


def distance(published: Published, median: float) -> float:
    """How far a median is from what is printed, in the unit of the quantity; 0 inside; NaN for no median."""
    return max(published.lower - median, median - published.upper, 0.0) if not math.isnan(median) else math.nan


def _percentile(published: Published, known: FloatArray) -> float:
    if not len(known):
        return math.nan
    lower = published.lower if math.isfinite(published.lower) else published.number
    upper = published.upper if math.isfinite(published.upper) else published.number
    below, tied = np.sum(known < lower), np.sum((known >= lower) & (known <= upper))
    return float(100.0 * (below + tied / 2.0) / len(known))


def _too_few(n: int, what: str) -> str:
    return f"{n} {what}; the rule needs {LEAST_VALUES}"
