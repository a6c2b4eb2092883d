"""How many detections of each kind there are, and how many are false.

Idea     counts of statuses; rates per field and per deg² with exact Poisson intervals, each kind apart. The purity has
         an interval from resampled fields beside the binomial one.
Source   Valtchanov et al. 2001, Sect. 6: a "false" detection has no counterpart in the input list, be it a
         fluctuation, a blend off its sources or a source below the count limit.
Limits   a duplicate has a listed counterpart and is therefore not false by the paper's rule; it is counted beside.
         The strict number, fluctuations alone, is `spurious`. Blends and duplicates of one field are not independent:
         their Poisson intervals are lower limits of the truth.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.intervals import garwood, jeffreys
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.resampling import design_effect, fraction_interval_fields, n_field_groups
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

IN_SCOPE_STATUSES = ("matched", "duplicate", "faint", "blend", "spurious")
ALL_STATUSES = (*IN_SCOPE_STATUSES, "outside", "missed")
FALSE_STATUSES = ("faint", "blend", "spurious")  # what the paper calls false
RATES = ("false", "spurious", "blend", "faint", "duplicate")


@dataclass(slots=True)
class StatusCounts:
    """Rows of one cell, method and rule by (status, kind of the source), and of each field the purity's numbers.

    n_fields: realisations of the cell, for the intervals from resampled fields.
    """

    n_fields: int = 1
    n: Counter[tuple[str, str]] = field(default_factory=Counter)
    by_field: NDArray[np.int64] = field(init=False)  # (groups of fields, 2): matched, detections in scope

    def __post_init__(self) -> None:
        self.by_field = np.zeros((n_field_groups(self.n_fields), 2), dtype=np.int64)

    def add(self, matches: DataFrame | MatchRows) -> None:
        """Add the rows of one rule."""
        rows = MatchRows.of(matches)
        (status, statuses), (kind, kinds) = rows.texts("status"), rows.texts("kind_true")
        known = (status >= 0) & (kind >= 0)
        pairs = np.bincount(status[known] * len(kinds) + kind[known], minlength=len(statuses) * len(kinds))
        for place in np.flatnonzero(pairs):
            self.n[statuses[place // len(kinds)], kinds[place % len(kinds)]] += int(pairs[place])
        n_groups = len(self.by_field)
        group = rows.integers("realisation") % n_groups
        for column, counted in enumerate((IN_SCOPE_STATUSES[:1], IN_SCOPE_STATUSES)):
            self.by_field[:, column] += np.bincount(group[rows.has("status", *counted)], minlength=n_groups)

    def of(self, *statuses: str) -> int:
        """Rows of some statuses, any kind."""
        return sum(n for (status, _), n in self.n.items() if status in statuses)

    def table(self, n_fields: int, area_deg2: float = float("nan")) -> DataFrame:
        """One row for each status (kind "all"), and one for each kind of source it has.

        area_deg2: summed over all fields. Columns: n, per_field with lower and upper, per_deg2 with per_deg2_lower and
        per_deg2_upper (Garwood).
        """
        import pandas as pd

        rows = [(status, "all", self.of(status)) for status in ALL_STATUSES]
        rows += [(s, k, self.n[(s, k)]) for s, k in sorted(self.n, key=lambda p: (ALL_STATUSES.index(p[0]), p[1])) if k]
        frame = pd.DataFrame(rows, columns=["status", "kind", "n"])
        lower, upper = garwood(frame["n"])
        for divisor, names in (
            (float(n_fields), ("per_field", "lower", "upper")),
            (area_deg2, ("per_deg2", "per_deg2_lower", "per_deg2_upper")),
        ):
            share = 1.0 / divisor if divisor > 0 else float("nan")
            for name, values in zip(names, (frame["n"], lower, upper), strict=True):
                frame[name] = values * share
        return frame

    def false_row(self, n_fields: int, area_deg2: float, weights: FloatArray | None = None) -> dict[str, float]:
        """Numbers and rates of false detections, and the purity.

        area_deg2: summed over all fields; NaN rates without any. weights: of `resampling.field_weights` for the groups
        of `by_field`; None for no interval of resampled fields.
        """
        row: dict[str, float] = {"n_detections": self.of(*IN_SCOPE_STATUSES), "n_false": self.of(*FALSE_STATUSES)}
        row |= {f"n_{status}": self.of(status) for status in IN_SCOPE_STATUSES}
        for name in RATES:
            lower, upper = garwood(row[f"n_{name}"])
            for unit, divisor in (("field", float(n_fields)), ("deg2", area_deg2)):
                share = 1.0 / divisor if divisor > 0 else float("nan")
                row[f"{name}_per_{unit}"] = row[f"n_{name}"] * share
                row[f"{name}_per_{unit}_lower"] = float(lower) * share
                row[f"{name}_per_{unit}_upper"] = float(upper) * share
        return row | self._purity(weights)

    def _purity(self, weights: FloatArray | None) -> dict[str, float]:
        matched, tried = self.by_field[:, 0], self.by_field[:, 1]
        drawn = np.empty((0, len(tried))) if weights is None else weights
        n_matched, n = int(matched.sum()), int(tried.sum())
        lower, upper = jeffreys(n_matched, n)
        lower_fields, upper_fields = fraction_interval_fields(drawn, matched, tried)
        return {
            "purity": n_matched / n if n else float("nan"),
            "purity_lower": float(lower),
            "purity_upper": float(upper),
            "purity_lower_fields": float(lower_fields),
            "purity_upper_fields": float(upper_fields),
            "purity_design_effect": float(design_effect(matched, tried)),
        }
