"""logN–logS: sources in the sky, detections counted without cross-identification, and the false ones among them.

Idea     simple counting inside the region, per deg², differential and integral, against true flux (input) or
         measured flux (detections).
Source   Valtchanov et al. 2001, Sect. 8, figures of the differential and integral counts.
Limits   no correction for incompleteness or Eddington bias: that is what the comparison shows. Integral points are
         correlated and must not be fitted as if they were not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.bins import FLUX_BINS
from survey_mc.stats.false_detections import FALSE_STATUSES
from survey_mc.stats.intervals import garwood
from survey_mc.stats.match_rows import MatchRows

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(slots=True)
class NumberCounts:
    """Numbers by flux bin (last: overflow) of one cell, method and rule."""

    region_arcmin: float
    n_input: NDArray[np.int64] = field(init=False)
    n_detected: NDArray[np.int64] = field(init=False)
    n_false: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.n_input, self.n_detected, self.n_false = np.zeros((3, FLUX_BINS.size + 1), dtype=np.int64)

    def add_truth(self, truth: DataFrame) -> None:
        """Add all true sources inside the region, however faint."""
        inside = truth["offaxis_arcmin"].to_numpy(np.float64) <= self.region_arcmin
        self.n_input += FLUX_BINS.count(truth["flux_cgs"].to_numpy(np.float64)[inside])

    def add(self, matches: DataFrame | MatchRows) -> None:
        """Add the detections of one rule that are inside the region."""
        rows = MatchRows.of(matches)
        inside = (rows.integers("det_id") >= 0) & (rows.numbers("offaxis_arcmin") <= self.region_arcmin)
        is_false = inside & rows.has("status", *FALSE_STATUSES)
        flux_cgs = rows.numbers("flux_cgs")
        self.n_detected += FLUX_BINS.count(flux_cgs[inside])
        self.n_false += FLUX_BINS.count(flux_cgs[is_false])

    def differential(self, area_deg2: float, input_area_deg2: float) -> DataFrame:
        """Occupied bins with numbers and densities per deg² and bin.

        area_deg2, input_area_deg2: summed over all fields with detections, and over those with a truth.
        """
        import pandas as pd

        used = (self.n_input + self.n_detected)[:-1] > 0
        edges = FLUX_BINS.edges
        numbers = {"input": self.n_input[:-1], "detected": self.n_detected[:-1], "false": self.n_false[:-1]}
        columns = {"flux_min_cgs": edges[:-1], "flux_max_cgs": edges[1:]} | _densities(
            numbers, area_deg2, input_area_deg2
        )
        return pd.DataFrame({name: values[used] for name, values in columns.items()})

    def integral(self, area_deg2: float, input_area_deg2: float) -> DataFrame:
        """Numbers and densities at and above each lower bin edge, from the faintest occupied to the brightest bin."""
        import pandas as pd

        above = [np.cumsum(n[::-1])[::-1][:-1] for n in (self.n_input, self.n_detected, self.n_false)]
        anything = np.flatnonzero((self.n_input + self.n_detected)[:-1] > 0)
        used = slice(anything[0], anything[-1] + 1) if len(anything) else slice(0, 0)
        numbers = dict(zip(("input", "detected", "false"), above, strict=True))
        columns = {"flux_min_cgs": FLUX_BINS.edges[:-1]} | _densities(numbers, area_deg2, input_area_deg2)
        return pd.DataFrame({name: values[used] for name, values in columns.items()})


def _densities(
    numbers: dict[str, NDArray[np.int64]], area_deg2: float, input_area_deg2: float
) -> dict[str, NDArray[np.generic]]:
    """n_…, …_per_deg2 and its Garwood interval for each kind of number; NaN densities without any area."""
    columns: dict[str, NDArray[np.generic]] = {}
    for name, n in numbers.items():
        area = input_area_deg2 if name == "input" else area_deg2
        area = area if area > 0 else float("nan")
        lower, upper = garwood(n)
        columns |= {
            f"n_{name}": n,
            f"{name}_per_deg2": n / area,
            f"{name}_per_deg2_lower": lower / area,
            f"{name}_per_deg2_upper": upper / area,
        }
    return columns
