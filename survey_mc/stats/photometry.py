"""How well counts and fluxes come back: measured over true, for matched sources.

Idea     the ratio's name says its denominator: input counts (un-vignetted, the paper's), expected counts, or flux.
         Median with 16 % and 84 % for the skewed truth, mean and standard deviation to compare with the paper.
Source   Valtchanov et al. 2001, Sect. 6.3 and 8: SCTS(out)/SCTS(in), mean and st. dev.
Limits   conditional on being found: near the limit only upward fluctuations are (Eddington bias). Quantiles come from
         a histogram with steps of 0.004 dex (0.9 %) between 0.01 and 100.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.stats.grouped import GroupedValues
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.selections import selections

if TYPE_CHECKING:
    from pandas import DataFrame

RATIOS = {
    "counts / counts_onaxis": ("counts", "counts_onaxis"),
    "counts / counts_expected": ("counts", "counts_expected"),
    "flux / flux_true": ("flux_cgs", "flux_true_cgs"),
}
QUANTILES = (0.5, 0.16, 0.84)
RATIO_EDGES = 10.0 ** np.linspace(-2.0, 2.0, 1001)


def _empty() -> dict[str, GroupedValues]:
    return {name: GroupedValues(RATIO_EDGES, is_log=True) for name in RATIOS}


@dataclass(slots=True)
class Photometry:
    """Ratios of one cell, method and rule."""

    ratios: dict[str, GroupedValues] = field(default_factory=_empty)

    def add(self, matches: DataFrame | MatchRows) -> None:
        """Add the matched rows of one rule."""
        rows = MatchRows.of(matches)
        matched = rows.where(rows.has("status", "matched"))
        belongs = selections(matched)
        for name, (measured, true) in RATIOS.items():
            denominator = matched.numbers(true)
            known = denominator > 0
            ratio = np.full(len(matched), np.nan)
            ratio[known] = matched.numbers(measured)[known] / denominator[known]
            self.ratios[name].add(belongs, ratio)

    def table(self, flux_limit_cgs: float = float("nan")) -> DataFrame:
        """A row for each ratio and part: n, median, q16 and q84 with intervals, mean, mean_err, stdev."""
        import pandas as pd

        rows = []
        for name, values in self.ratios.items():
            for part in values.parts(flux_limit_cgs):
                s = part.summary
                quantiles = s.quantiles_with_intervals(QUANTILES).ravel()
                rows.append(
                    (*(name, part.selection, part.lower_edge, part.upper_edge, s.n), *quantiles,
                     *(s.mean, s.mean_err, s.stdev))
                )  # fmt: skip
        ends = (f"{name}{end}" for name in ("median", "q16", "q84") for end in ("", "_lower", "_upper"))
        columns = ["ratio", "selection", "lower_edge", "upper_edge", "n", *ends, "mean", "mean_err", "stdev"]
        return pd.DataFrame(rows, columns=columns)
