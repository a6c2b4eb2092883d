"""How many detections of each kind there are, and how many are false.

Idea     counts of statuses; rates per field and per deg² with exact Poisson intervals.
Source   Valtchanov et al. 2001, Sect. 6: a "false" detection has no counterpart in the input list, be it a
         fluctuation, a blend off its sources or a source below the count limit.
Limits   a duplicate has a listed counterpart and is therefore not false by the paper's rule; it is counted beside.
         The strict number, fluctuations alone, is `spurious`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from survey_mc.stats.intervals import garwood, jeffreys

if TYPE_CHECKING:
    from pandas import DataFrame

IN_SCOPE_STATUSES = ("matched", "duplicate", "faint", "blend", "spurious")
ALL_STATUSES = (*IN_SCOPE_STATUSES, "outside", "missed")
FALSE_STATUSES = ("faint", "blend", "spurious")


@dataclass(slots=True)
class StatusCounts:
    """Rows of one cell, method and rule by (status, kind of the source)."""

    n: Counter[tuple[str, str]] = field(default_factory=Counter)

    def add(self, matches: DataFrame) -> None:
        pairs = matches.groupby(["status", "kind_true"], observed=True).size()
        for (status, kind), n_rows in pairs.items():
            self.n[(str(status), str(kind))] += int(n_rows)

    def of(self, *statuses: str) -> int:
        """Rows of some statuses, any kind."""
        return sum(n for (status, _), n in self.n.items() if status in statuses)

    def table(self, n_fields: int) -> DataFrame:
        """One row for each status (kind "all"), and one for each kind of source it has: n, per_field, lower, upper."""
        import pandas as pd

        rows = [(status, "all", self.of(status)) for status in ALL_STATUSES]
        rows += [(s, k, self.n[(s, k)]) for s, k in sorted(self.n, key=lambda p: (ALL_STATUSES.index(p[0]), p[1])) if k]
        frame = pd.DataFrame(rows, columns=["status", "kind", "n"])
        lower, upper = garwood(frame["n"])
        fields = n_fields or float("nan")
        return frame.assign(per_field=frame["n"] / fields, lower=lower / fields, upper=upper / fields)

    def false_row(self, n_fields: int, area_deg2: float) -> dict[str, float]:
        """Numbers and rates of false detections. area_deg2: summed over all fields; NaN rates without any."""
        row: dict[str, float] = {"n_detections": self.of(*IN_SCOPE_STATUSES), "n_false": self.of(*FALSE_STATUSES)}
        row |= {f"n_{status}": self.of(status) for status in IN_SCOPE_STATUSES}
        for name in ("false", "spurious"):
            lower, upper = garwood(row[f"n_{name}"])
            for unit, divisor in (("field", float(n_fields)), ("deg2", area_deg2)):
                share = 1.0 / divisor if divisor > 0 else float("nan")
                row[f"{name}_per_{unit}"] = row[f"n_{name}"] * share
                row[f"{name}_per_{unit}_lower"] = float(lower) * share
                row[f"{name}_per_{unit}_upper"] = float(upper) * share
        n = row["n_detections"]
        purity_lower, purity_upper = jeffreys(row["n_matched"], n)
        row["purity"] = row["n_matched"] / n if n else float("nan")
        row["purity_lower"], row["purity_upper"] = float(purity_lower), float(purity_upper)
        return row
