"""One pass over the matches and detections of a cell and method: all sums of all tables, for both rules.

Idea     pieces stream through; only the sums stay. Methods of a cell resample the same fields, so their limits can be
         compared in pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.match.chance import completeness_without_chance
from survey_mc.report.chance_rates import TRUTH_COLUMNS as CHANCE_COLUMNS
from survey_mc.report.chance_rates import ChanceSums, ListedSources
from survey_mc.report.classified import ClassSums, extent_statistics
from survey_mc.report.pieces import Joined, joined_pieces
from survey_mc.report.source import CellLike, MethodLike, RunSource
from survey_mc.rng import stream
from survey_mc.stats import Astrometry, CompletenessCounts, NumberCounts, Photometry, StatusCounts
from survey_mc.stats.bins import COUNTS_BINS, FLUX_BINS
from survey_mc.stats.extent_sums import MAX_GROUPS
from survey_mc.stats.resampling import field_weights, n_field_groups
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

RULES = ("nearest", "origin")
KINDS = ("all", "point", "extended")
HEADLINE_LEVEL = 0.9
TEXTS = {"rule": object, "status": object, "kind_true": object}
MATCH_COLUMNS = (
    *("realisation", "rule", "status", "det_id", "sep_arcsec", "kind_true", "flux_true_cgs"),
    *("counts_onaxis", "counts_expected", "counts", "flux_cgs", "offaxis_arcmin"),
)

Rows = dict[str, "DataFrame"]


@dataclass(frozen=True, slots=True)
class InputCounts:
    """True sources of a cell by flux bin, how many fields they are from, and the input list of the first fields."""

    n_input: NDArray[np.int64]
    n_fields: int
    listed: ListedSources


def input_counts(source: RunSource, cell: CellLike) -> InputCounts:
    """Count the true sources inside the region of a cell."""
    numbers = NumberCounts(cell.region_arcmin)
    match_params = source.lock.get("campaign", {}).get("match", {})
    listed = ListedSources(cell, match_params.get("counts_min_on", "counts_expected"))
    for truth in source.frames("truth", cell.label, columns=(*CHANCE_COLUMNS, "flux_cgs", listed.counts_column)):
        numbers.add_truth(truth)
        listed.add(truth)
    return InputCounts(numbers.n_input, source.realisations_done("truth", cell.label), listed)


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

    def __init__(self, cell: CellLike, method: MethodLike, rule: str, listed: ListedSources) -> None:
        self.rule = rule
        self.by_kind = {kind: KindSums(cell) for kind in KINDS}
        self.counts = NumberCounts(cell.region_arcmin)
        self.statuses = StatusCounts(cell.realisations)
        self.classes = ClassSums(extent_statistics(method), cell.realisations)
        self.chance = ChanceSums(listed) if rule == "nearest" else None

    def add(self, joined: Joined) -> None:
        """Add the rows of this rule."""
        matches = joined.matches
        self.classes.add(joined)
        if self.chance is not None:
            self.chance.add(joined)
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
    """Rows of every table for one cell and method, in any order of columns; nothing if no field is done."""
    import pandas as pd

    n_fields = source.realisations_done("matches", cell.label, method.label)
    if not n_fields:
        return {}
    sums = {rule: RuleSums(cell, method, rule, inputs.listed) for rule in RULES}
    matches = (m.astype(TEXTS) for m in source.frames("matches", cell.label, method.label, columns=MATCH_COLUMNS))
    for piece in joined_pieces(matches, source.frames("detections", cell.label, method.label)):
        for rule in RULES:
            sums[rule].add(piece.where(piece.matches["rule"].to_numpy(object) == rule))
    collected: dict[str, list[DataFrame]] = {}
    for rule in RULES:
        for name, rows in _rule_tables(cell, sums[rule], n_fields, inputs).items():
            if not len(rows):
                continue
            identity = {"cell": cell.label, "band": cell.band, "exposure_ks": cell.exposure_ks, "method": method.label}
            collected.setdefault(name, []).append(rows.assign(**identity, rule=rule, n_fields=n_fields))
    return {name: pd.concat(frames, ignore_index=True) for name, frames in collected.items()}


def _rule_tables(cell: CellLike, sums: RuleSums, n_fields: int, inputs: InputCounts) -> Rows:
    import pandas as pd

    area_deg2 = cell.region_deg2
    sums.counts.n_input[:] = inputs.n_input
    areas_deg2 = (area_deg2 * n_fields, area_deg2 * inputs.n_fields)
    rows: dict[str, list[DataFrame]] = {}
    chance = float("nan") if sums.chance is None else sums.chance.of_lost_sources()
    for kind in sums.kinds():
        for name, frame in _kind_tables(cell, sums.by_kind[kind], chance).items():
            rows.setdefault(name, []).append(frame.assign(kind=kind))
    weights = _field_weights(cell, n_field_groups(cell.realisations))
    lots = _field_weights(cell, n_field_groups(cell.realisations, MAX_GROUPS))
    return {name: pd.concat(frames, ignore_index=True) for name, frames in rows.items()} | {
        "counts_differential": sums.counts.differential(*areas_deg2),
        "counts_integral": sums.counts.integral(*areas_deg2),
        "false_detections": pd.DataFrame([sums.statuses.false_row(n_fields, areas_deg2[0], weights)]),
        "status_counts": sums.statuses.table(n_fields, areas_deg2[0]),
        "chance_matches": pd.DataFrame() if sums.chance is None else sums.chance.table(),
        **sums.classes.tables(lots, areas_deg2[0]),
    }


def _kind_tables(cell: CellLike, sums: KindSums, chance: float) -> Rows:
    """The tables that have rows for every kind of source. chance: of a lost source to be matched, NaN if not known."""
    import pandas as pd

    curves, limits, flux_limit_cgs = [], [], float("nan")
    for quantity, counts in sums.completeness.items():
        curve = counts.table(_resampling(cell, quantity)).assign(quantity=quantity)
        corrected = completeness_without_chance(curve["completeness"].to_numpy(np.float64), chance)
        curves.append(curve.assign(completeness_corrected=corrected))
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


def _field_weights(cell: CellLike, n_groups: int) -> FloatArray:
    """How often each group of fields is drawn, the same for every method and rule of a cell."""
    return field_weights(n_groups, stream(cell.label, f"resampled fields, {n_groups}"))
