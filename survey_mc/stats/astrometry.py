"""How far detections are from their sources.

Idea     separations of matched pairs: median, the radius of 68.27 % ("one sigma"), mean and root mean square.
Source   Valtchanov et al. 2001, Tab. "one sigma positional error", for more than 100 counts.
Limits   the nearest rule cuts separations at its radius; the origin rule does not. Quantiles come from a histogram with
         steps of 0.02″ up to 120″.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.stats.grouped import GroupedValues
from survey_mc.stats.intervals import ONE_SIGMA
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.selections import selections

if TYPE_CHECKING:
    from pandas import DataFrame

SEPARATION_EDGES_ARCSEC = np.linspace(0.0, 120.0, 6001)


def _empty() -> GroupedValues:
    return GroupedValues(SEPARATION_EDGES_ARCSEC, is_log=False)


@dataclass(slots=True)
class Astrometry:
    """Separations (arcsec) of one cell, method and rule."""

    separations: GroupedValues = field(default_factory=_empty)

    def add(self, matches: DataFrame | MatchRows) -> None:
        """Add the matched rows of one rule."""
        rows = MatchRows.of(matches)
        matched = rows.where(rows.has("status", "matched"))
        self.separations.add(selections(matched), matched.numbers("sep_arcsec"))

    def table(self, flux_limit_cgs: float = float("nan")) -> DataFrame:
        """A row for each part: n, median and one-sigma radius with intervals, mean, mean_err, rms (all arcsec)."""
        import pandas as pd

        rows = []
        for part in self.separations.parts(flux_limit_cgs):
            s = part.summary
            rows.append(
                (
                    *(part.selection, part.lower_edge, part.upper_edge, s.n),
                    *s.quantiles_with_intervals((0.5, ONE_SIGMA)).ravel(),
                    *(s.mean, s.mean_err, s.rms),
                )
            )
        names = (
            "selection lower_edge upper_edge n median_arcsec median_lower_arcsec median_upper_arcsec "
            "one_sigma_arcsec one_sigma_lower_arcsec one_sigma_upper_arcsec mean_arcsec mean_err_arcsec rms_arcsec"
        )
        return pd.DataFrame(rows, columns=names.split())
