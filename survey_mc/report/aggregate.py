"""One pass over the matches of a cell and method: all sums of all tables, for both rules.

Idea     pieces stream through; only the sums stay. Methods of a cell resample the same fields, so their limits can be
         compared in pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.report.source import CellLike, MethodLike, RunSource
from survey_mc.rng import stream
from survey_mc.stats import Astrometry, CompletenessCounts, NumberCounts, Photometry, StatusCounts
from survey_mc.stats.bins import COUNTS_BINS, FLUX_BINS
from survey_mc.units import deg2_of_circle

if TYPE_CHECKING:
    from pandas import DataFrame

RULES = ("nearest", "origin")
KINDS = ("all", "point", "extended")
HEADLINE_LEVEL = 0.9
TRUTH_COLUMNS = ("offaxis_arcmin", "flux_cgs")
MATCH_COLUMNS = (
    *("realisation", "rule", "status", "det_id", "sep_arcsec", "kind_true", "flux_true_cgs"),
    *("counts_onaxis", "counts_expected", "counts", "flux_cgs", "offaxis_arcmin"),
)

Rows = dict[str, "DataFrame"]


@dataclass(frozen=True, slots=True)
class InputCounts:
    """True sources of a cell by flux bin, and how many fields they are from."""

    n_input: NDArray[np.int64]
    n_fields: int


def input_counts(source: RunSource, cell: CellLike) -> InputCounts:
    """Count the true sources inside the region of a cell."""
    numbers = NumberCounts(cell.region_arcmin)
    for truth in source.frames("truth", cell.label, columns=TRUTH_COLUMNS):
        numbers.add_truth(truth)
    return InputCounts(numbers.n_input, source.realisations_done("truth", cell.label))


class KindSums:
    """What is found of one kind of true sources, and how well it is measured."""

    def __init__(self, cell: CellLike) -> None:
        self.completeness = {
            bins.quantity: CompletenessCounts(bins, cell.realisations) for bins in (FLUX_BINS, COUNTS_BINS)
        }
        self.photometry = Photometry()
        self.astrometry = Astrometry()

    def add(self, matches: DataFrame) -> None:
        """Add the rows of this kind."""
        for completeness in self.completeness.values():
            completeness.add(matches)
        self.photometry.add(matches)
        self.astrometry.add(matches)

    @property
    def is_empty(self) -> bool:
        return not any(counts.n_true.any() for counts in self.completeness.values())


class RuleSums:
    """All sums of one cell, method and rule."""

    def __init__(self, cell: CellLike, rule: str) -> None:
        self.rule = rule
        self.by_kind = {kind: KindSums(cell) for kind in KINDS}
        self.counts = NumberCounts(cell.region_arcmin)
        self.statuses = StatusCounts()

    def add(self, matches: DataFrame) -> None:
        """Add the rows of this rule."""
        self.counts.add(matches)
        self.statuses.add(matches)
        self.by_kind["all"].add(matches)
        kind_true = matches["kind_true"].to_numpy(object)
        for kind in KINDS[1:]:
            rows = matches[kind_true == kind]
            if len(rows):
                self.by_kind[kind].add(rows)

    def kinds(self) -> tuple[str, ...]:
        """All kinds where there are points and extended sources, else "all", which is then the one there is."""
        return KINDS[:1] if any(self.by_kind[kind].is_empty for kind in KINDS[1:]) else KINDS


def method_tables(source: RunSource, cell: CellLike, method: MethodLike, inputs: InputCounts) -> Rows:
    """Rows of every table for one cell and method, identity columns first; nothing if no field is done."""
    import pandas as pd

    n_fields = source.realisations_done("matches", cell.label, method.label)
    if not n_fields:
        return {}
    sums = {rule: RuleSums(cell, rule) for rule in RULES}
    for matches in source.frames("matches", cell.label, method.label, columns=MATCH_COLUMNS):
        for rule in RULES:
            sums[rule].add(matches[matches["rule"].to_numpy(object) == rule])
    collected: dict[str, list[DataFrame]] = {}
    for rule in RULES:
        for name, rows in _rule_tables(cell, sums[rule], n_fields, inputs).items():
            identity = {"cell": cell.label, "band": cell.band, "exposure_ks": cell.exposure_ks, "method": method.label}
            head = pd.DataFrame({**identity, "rule": rule, "n_fields": n_fields}, index=rows.index)
            collected.setdefault(name, []).append(pd.concat([head, rows], axis=1))
    return {name: pd.concat(frames, ignore_index=True) for name, frames in collected.items()}


def _rule_tables(cell: CellLike, sums: RuleSums, n_fields: int, inputs: InputCounts) -> Rows:
    import pandas as pd

    area_deg2 = deg2_of_circle(cell.region_arcmin)
    sums.counts.n_input[:] = inputs.n_input
    areas_deg2 = (area_deg2 * n_fields, area_deg2 * inputs.n_fields)
    rows: dict[str, list[DataFrame]] = {}
    for kind in sums.kinds():
        for name, frame in _kind_tables(cell, sums.by_kind[kind]).items():
            rows.setdefault(name, []).append(frame.assign(kind=kind))
    return {name: pd.concat(frames, ignore_index=True) for name, frames in rows.items()} | {
        "counts_differential": sums.counts.differential(*areas_deg2),
        "counts_integral": sums.counts.integral(*areas_deg2),
        "false_detections": pd.DataFrame([sums.statuses.false_row(n_fields, area_deg2 * n_fields)]),
        "status_counts": sums.statuses.table(n_fields),
    }


def _kind_tables(cell: CellLike, sums: KindSums) -> Rows:
    """The tables that have rows for every kind of source."""
    import pandas as pd

    curves, limits, flux_limit_cgs = [], [], float("nan")
    for quantity, counts in sums.completeness.items():
        curves.append(counts.table(_resampling(cell, quantity)).assign(quantity=quantity))
        if not len(curves[-1]):
            continue
        for limit in counts.limits(_resampling(cell, quantity)):
            values = (limit.level, limit.value, limit.lower, limit.upper, limit.state)
            limits.append((quantity, *values))
            if quantity == FLUX_BINS.quantity and limit.level == HEADLINE_LEVEL:
                flux_limit_cgs = limit.value
    return {
        "completeness": pd.concat(curves, ignore_index=True),
        "completeness_limit": pd.DataFrame(limits, columns=["quantity", "level", "limit", "lower", "upper", "state"]),
        "photometry": sums.photometry.table(flux_limit_cgs),
        "astrometry": sums.astrometry.table(flux_limit_cgs),
    }


def _resampling(cell: CellLike, quantity: str) -> np.random.Generator:
    """The same resampled fields for every method and rule of a cell."""
    return stream(f"{cell.label}/{quantity}", "resampled fields")
