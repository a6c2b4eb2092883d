"""Which named option explains a difference: measured on the same fields, with the same statistic.

Idea     every option that concerns a claim is evaluated; one counts if its median is nearer to what is printed by at
         least a third of the distance (in the unit of the quantity). Of those under which the claim is reproduced, the
         nearest one is the cause: it explains. Without such, the nearest of the others explains in part. Of equally
         near ones it is the one in whose middle the published value lies best. A diagnosis, which needs what the paper
         could not know, is named only where no reading or setting helps.
Limits   several options are tried for one claim and the best is named: it shows what suffices, not what happened in
         2001. Differences that need two options together are only explained in part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from survey_mc.paper.claims import Published
from survey_mc.paper.options import Option, option_views
from survey_mc.paper.rows import StudyRows
from survey_mc.paper.statistics import Computed, Statistic
from survey_mc.paper.verdict import Judgement, distance, judge, judge_constant
from survey_mc.paper.views import View

LEAST_SHARE = 1.0 / 3.0
MIDDLE = 50.0


@dataclass(frozen=True, slots=True)
class Effect:
    """A claim under one option. share: part of the distance to the published value that it removes (1: all)."""

    claim: str
    option: Option
    judgement: Judgement
    share: float


@dataclass(frozen=True, slots=True)
class Cause:
    """The option that explains a difference best (None: none does) and how far, in words."""

    effect: Effect | None
    words: str


def judged(study: StudyRows, statistic: Statistic, view: View, published: Published) -> Judgement:
    """The verdict on a statistic under a view; groups need as many fields as single images do."""
    n_fields = study.n_fields(view) if statistic.sampling == "groups of ten fields" else None
    return judge(published, statistic.values(study, view), n_fields)


def effects_of(study: StudyRows, statistic: Statistic, published: Published, base: Judgement) -> list[Effect]:
    """All options that concern a claim and whose campaigns were run whole, evaluated."""
    effects = []
    for option, view in option_views(statistic):
        if not study.lack(view):
            judgement = judged(study, statistic, view, published)
            differs = base.verdict == "differs"
            share = removed_share(published, base.spread.median, judgement.spread.median) if differs else math.nan
            effects.append(Effect(statistic.claim, option, judgement, share))
    return effects


def effects_of_constant(computed: Computed, published: Published, base: Judgement) -> list[Effect]:
    """The other ways to compute a number, evaluated."""
    effects = []
    for other in computed.alternatives:
        judgement = judge_constant(published, float(other.values()[0]))
        share = removed_share(published, base.spread.median, judgement.spread.median)
        effects.append(Effect(computed.claim, Option(other.name, other.about, (computed.claim,)), judgement, share))
    return effects


def removed_share(published: Published, before: float, after: float) -> float:
    """1 − distance of the option's median over that of the base's; NaN if one is unknown or the base's is 0."""
    far, near = distance(published, before), distance(published, after)
    if math.isnan(far) or math.isnan(near) or far == 0.0:
        return math.nan
    if math.isinf(far):
        return 0.0 if math.isinf(near) else 1.0
    return 1.0 - near / far


def _nearness(effect: Effect) -> tuple[bool, float, float]:
    return not effect.option.is_diagnosis, effect.share, -abs(effect.judgement.percentile - MIDDLE)


def cause_of(effects: list[Effect], has_options: bool) -> Cause:
    """The cause of a difference among its measured effects."""
    helping = [effect for effect in effects if effect.share >= LEAST_SHARE]
    explaining = [effect for effect in helping if effect.judgement.verdict == "reproduced"]
    if explaining:
        best = max(explaining, key=_nearness)
        return Cause(best, "explains")
    if helping:
        best = max(helping, key=_nearness)
        return Cause(best, f"explains in part ({100 * best.share:.0f} % of the distance)")
    if not has_options:
        return Cause(None, "not measured: the option campaigns were not run")
    return Cause(None, f"none found ({len(effects)} evaluated)")
