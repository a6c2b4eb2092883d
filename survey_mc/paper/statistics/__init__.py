"""What stands for each published value, one file a test of the paper."""

from __future__ import annotations

from functools import cache

from survey_mc.paper.statistics import classification, cost, simulator, test1, test2, test3, test4, test5
from survey_mc.paper.statistics.statistic import Computed, Evidence, NotCompared, Reading, Statistic

__all__ = ["Computed", "Evidence", "NotCompared", "Reading", "Statistic", "evidence_by_claim"]

_PARTS = (simulator, test1, test2, test3, test4, classification, test5, cost)


@cache
def evidence_by_claim() -> dict[str, Evidence]:
    """What stands for each claim, by its id."""
    return {evidence.claim: evidence for part in _PARTS for evidence in part.evidence()}
