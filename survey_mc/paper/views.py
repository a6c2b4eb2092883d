"""A view: which of our numbers a statistic looks at.

Idea     the same function gives the statistic of the base campaign and, with another view, that of every option: other
         campaign, method, matching rule, denominator or reading of the words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from survey_mc.paper.study import GRID, TEST_5
from survey_mc.stats.false_detections import FALSE_STATUSES

LABELS = {
    "emldetect": "EMLDETECT",
    "vtpdetect": "VTPDETECT",
    "wavdetect": "WAVDETECT",
    "ewavelet": "EWAVELET",
    "gauss_se": "G+SE",
    "mr1_se": "MR/1+SE",
}
ALL_METHODS = tuple(LABELS.values())

SOFT_10, SOFT_100, HARD_10, HARD_100 = (
    f"xmm_epic-{band}-{exposure}ks" for band in ("soft", "hard") for exposure in (10, 100)
)

InputCounts = Literal["counts_onaxis", "counts_expected"]
MeasuredCounts = Literal["counts", "counts_corrected"]


@dataclass(frozen=True, slots=True)
class View:
    """What a statistic is computed from.

    methods: labels in the campaign; the first is the one a claim is about. beside: campaign of the other methods, the
    same if empty. cells: labels. rule: of the matches. input_counts, measured_counts: denominator and numerator of
    ratios. false: statuses that count as false. region_arcmin: false detections inside it, within the campaign's own
    region. grid: campaign of isolated sources. reading: another reading of the
    words, by its name in the statistic; empty for the first.
    """

    campaign: str
    methods: tuple[str, ...] = ("MR/1+SE",)
    cells: tuple[str, ...] = (SOFT_10,)
    rule: str = "nearest"
    input_counts: InputCounts = "counts_onaxis"
    measured_counts: MeasuredCounts = "counts"
    false: tuple[str, ...] = FALSE_STATUSES
    region_arcmin: float = math.inf
    beside: str = ""
    grid: str = ""
    reading: str = ""

    @property
    def method(self) -> str:
        return self.methods[0]

    @property
    def cell(self) -> str:
        return self.cells[0]

    def campaign_of(self, method: str) -> str:
        """The campaign in which a method's matches are."""
        return self.campaign if method == self.method or not self.beside else self.beside

    @property
    def needs(self) -> tuple[tuple[str, str], ...]:
        """(campaign, method) pairs that must have been run."""
        own = tuple((self.campaign_of(method), method) for method in self.methods)
        return own + (tuple((self.grid, method) for method in self.methods) if self.grid else ())


def view_of_test_5(*cells: str, method: str = "MR/1+SE", grid: bool = False) -> View:
    """A view of Test 5."""
    return View(TEST_5, (method,), cells, grid=GRID if grid else "")
