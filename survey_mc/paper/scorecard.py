"""The scorecard: every published number beside ours, with a verdict by rule and the measured cause of a difference.

Idea     one row a claim, one function for each claim's statistic; a second table with every option's effect on it.
Source   rule: `verdict`; statistics: `statistics`; options: `options`, `causes`.
Limits   CPU times depend on the machine and stand in a table of their own; everything else is a function of the
         study's stored tables alone, so the same study gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.columns import Table
from survey_mc.paper.causes import Cause, Effect, cause_of, effects_of, effects_of_constant, judged
from survey_mc.paper.claims import Claim, load_claims
from survey_mc.paper.results import StudyResults
from survey_mc.paper.rows import StudyRows
from survey_mc.paper.scorecard_columns import CPU_TABLE, OPTION_EFFECTS, SCORECARD
from survey_mc.paper.statistics import Computed, Evidence, NotCompared, Statistic, evidence_by_claim
from survey_mc.paper.statistics.cost import cpu_table
from survey_mc.paper.verdict import Judgement, judge, judge_constant, spread_of

if TYPE_CHECKING:
    from pandas import DataFrame

DIGITS = 9  # significant ones in the tables
SPREAD_NUMBERS = ("median", "lower_68", "upper_68", "lower_95", "upper_95")
NO_CAUSE = Cause(None, "")


@dataclass(frozen=True, slots=True)
class Scorecard:
    """rows: `SCORECARD`; effects: `OPTION_EFFECTS`; cpu: `CPU_TABLE`, of this machine."""

    rows: DataFrame
    effects: DataFrame
    cpu: DataFrame


@dataclass(frozen=True, slots=True)
class _Judged:
    claim: Claim
    statistic: str
    sampling: str
    judgement: Judgement
    effects: list[Effect]
    cause: Cause = NO_CAUSE


def build_scorecard(results: StudyResults, claims: tuple[Claim, ...] | None = None) -> Scorecard:
    """Judge every claim (default all published ones) on a stored study. What was not run is not comparable."""
    study = StudyRows(results)
    evidence = evidence_by_claim()
    has_options = any(campaign.is_option for campaign in results.campaigns)
    every = [_judged(study, claim, evidence[claim.id], has_options) for claim in claims or load_claims()]
    rows = [_row(one) for one in every]
    effects = [_effect_row(effect) for one in every for effect in one.effects]
    return Scorecard(_frame(SCORECARD, rows), _frame(OPTION_EFFECTS, effects), cpu_table(study))


def write_scorecard(scorecard: Scorecard, root: Path) -> None:
    """Write `scorecard`, `option_effects` and `cpu_table`, each as .parquet and .csv, into a folder."""
    from survey_mc.report.tables import write_csv
    from survey_mc.store import write_frame

    root.mkdir(parents=True, exist_ok=True)
    tables = ((SCORECARD, scorecard.rows), (OPTION_EFFECTS, scorecard.effects), (CPU_TABLE, scorecard.cpu))
    for table, frame in tables:
        write_frame(root / f"{table.name}.parquet", table, frame)
        write_csv(root / f"{table.name}.csv", table, frame)


def verdict_counts(rows: DataFrame) -> Mapping[str, int]:
    """Number of claims by verdict."""
    return {str(verdict): int(n) for verdict, n in rows["verdict"].value_counts(sort=False).items()}


def _judged(study: StudyRows, claim: Claim, evidence: Evidence, has_options: bool) -> _Judged:
    if isinstance(evidence, NotCompared):
        return _Judged(claim, "", "", _no_values(evidence.reason), [])
    if isinstance(evidence, Computed):
        return _judged_computed(claim, evidence)
    return _judged_statistic(study, claim, evidence, has_options)


def _judged_computed(claim: Claim, computed: Computed) -> _Judged:
    values = computed.values()
    one = len(values) == 1
    judgement = judge_constant(claim.published, float(values[0])) if one else judge(claim.published, values)
    effects = effects_of_constant(computed, claim.published, judgement)
    cause = cause_of(effects, True) if judgement.verdict == "differs" else NO_CAUSE
    return _Judged(claim, computed.about, "computed", judgement, effects, cause)


def _judged_statistic(study: StudyRows, claim: Claim, statistic: Statistic, has_options: bool) -> _Judged:
    if lack := study.lack(statistic.view):
        return _Judged(claim, statistic.about, statistic.sampling, _no_values(lack), [])
    published = statistic.meaning or claim.published
    judgement = judged(study, statistic, statistic.view, published)
    effects = effects_of(study, statistic, published, judgement)
    cause = cause_of(effects, has_options) if judgement.verdict == "differs" else NO_CAUSE
    return _Judged(claim, statistic.about, statistic.sampling, judgement, effects, cause)


def _no_values(reason: str) -> Judgement:
    import numpy as np

    return Judgement("not comparable", reason, spread_of(np.empty(0)))


def _row(one: _Judged) -> dict[str, object]:
    claim, judgement, cause = one.claim, one.judgement, one.cause
    return {
        "id": claim.id,
        "where": claim.where,
        "quantity": claim.quantity,
        "method": claim.method,
        "condition": claim.condition,
        "published": claim.published.text,
        "unit": claim.unit,
        "statistic": one.statistic,
        "sampling": one.sampling,
        **_numbers(judgement),
        "reason": judgement.reason,
        "cause": cause.effect.option.name if cause.effect else "",
        "cause_median": _rounded(cause.effect.judgement.spread.median) if cause.effect else float("nan"),
        "cause_verdict": cause.effect.judgement.verdict if cause.effect else "",
        "effect": cause.words,
        "note": claim.note,
    }


def _effect_row(effect: Effect) -> dict[str, object]:
    return {
        "id": effect.claim,
        "option": effect.option.name,
        "about": effect.option.about,
        **_numbers(effect.judgement),
        "share": _rounded(effect.share),
    }


def _numbers(judgement: Judgement) -> dict[str, object]:
    spread = judgement.spread
    return {
        "n": spread.n,
        **{name: _rounded(getattr(spread, name)) for name in SPREAD_NUMBERS},
        "percentile": _rounded(judgement.percentile),
        "verdict": judgement.verdict,
    }


def _rounded(value: float) -> float:
    """To the digits that do not depend on the order in which a library adds."""
    return float(f"{value:.{DIGITS - 1}e}")


def _frame(table: Table, rows: list[dict[str, object]]) -> DataFrame:
    """The rows with exactly the declared columns and types."""
    import pandas as pd

    types = {c.name: "object" if c.dtype == "string" else c.dtype for c in table.columns}
    return pd.DataFrame(rows, columns=list(table.names)).astype(types)
