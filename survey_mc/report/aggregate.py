"""One pass over the matches and detections of a cell and method: all sums of all tables, for both rules.

Idea     pieces stream through; only the sums stay. Methods of a cell resample the same fields, so their limits can be
         compared in pairs.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.match.chance import completeness_without_chance
from survey_mc.report.chance_rates import PLACE_COLUMNS, ChanceSums, ListedSources
from survey_mc.report.chance_rates import TRUTH_COLUMNS as CHANCE_COLUMNS
from survey_mc.report.classified import ClassSums, detection_columns, extent_statistics
from survey_mc.report.pieces import NUMBERING, Joined, joined_pieces
from survey_mc.report.source import CellLike, MethodLike, RunSource
from survey_mc.report.table_parts import Part, Parts
from survey_mc.rng import stream
from survey_mc.stats import Astrometry, CompletenessCounts, NumberCounts, Photometry, StatusCounts
from survey_mc.stats.bins import COUNTS_BINS, FLUX_BINS
from survey_mc.stats.extent_sums import MAX_GROUPS
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.resampling import field_weights, n_field_groups
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

RULES = ("nearest", "origin")
KINDS = ("all", "point", "extended")
HEADLINE_LEVEL = 0.9
MATCH_COLUMNS = (
    *("realisation", "rule", "status", "det_id", "sep_arcsec", "kind_true", "flux_true_cgs"),
    *("counts_onaxis", "counts_expected", "counts", "flux_cgs", "offaxis_arcmin"),
)


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
    for truth in source.frames("truth", cell.label, columns=(*CHANCE_COLUMNS, listed.counts_column)):
        listed.add(truth)
        if listed.is_complete:
            break
    for truth in source.frames("truth", cell.label, columns=("flux_cgs", "offaxis_arcmin")):
        numbers.add_truth(truth)
    return InputCounts(numbers.n_input, source.realisations_done("truth", cell.label), listed)


class KindSums:
    """What is found of one kind of true sources, and how well it is measured."""

    def __init__(self, cell: CellLike) -> None:
        self.completeness = {
            bins.quantity: CompletenessCounts(bins, cell.realisations) for bins in (FLUX_BINS, COUNTS_BINS)
        }
        self.photometry = Photometry()
        self.astrometry = Astrometry()

    def add(self, matches: MatchRows) -> None:
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
        self.cell = cell
        self.by_kind = {"all": KindSums(cell)}
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
        self._add_by_kind(matches.where(matches.has("status", "matched", "missed")))

    def _add_by_kind(self, sources: MatchRows) -> None:
        """As long as there are points alone, their sums are those of all."""
        is_kind = {kind: sources.has("kind_true", kind) for kind in KINDS[1:]}
        if len(self.by_kind) == 1 and not is_kind["point"].all():
            self.by_kind |= {"point": deepcopy(self.by_kind["all"]), "extended": KindSums(self.cell)}
        self.by_kind["all"].add(sources)
        for kind in (*self.by_kind,)[1:]:
            if is_kind[kind].any():
                self.by_kind[kind].add(sources.where(is_kind[kind]))

    def kinds(self) -> tuple[str, ...]:
        """All kinds where there are points and extended sources, else "all", which is then the one there is."""
        is_mixed = len(self.by_kind) > 1 and not any(self.by_kind[kind].is_empty for kind in KINDS[1:])
        return KINDS if is_mixed else KINDS[:1]


def method_tables(source: RunSource, cell: CellLike, method: MethodLike, inputs: InputCounts) -> Parts:
    """The parts of every table for one cell and method; nothing if no field is done."""
    n_fields = source.realisations_done("matches", cell.label, method.label)
    if not n_fields:
        return {}
    sums = {rule: RuleSums(cell, method, rule, inputs.listed) for rule in RULES}
    matches = source.frames("matches", cell.label, method.label, columns=MATCH_COLUMNS)
    for piece in joined_pieces(matches, _detections(source, cell, method)):
        for rule in RULES:
            sums[rule].add(piece.where(piece.matches.has("rule", rule)))
    identity = {"cell": cell.label, "band": cell.band, "exposure_ks": cell.exposure_ks, "method": method.label}
    collected: dict[str, list[Part]] = {}
    for rule in RULES:
        for name, parts in _rule_tables(cell, sums[rule], n_fields, inputs).items():
            whole = (part.having(**identity, rule=rule, n_fields=n_fields) for part in parts)
            collected.setdefault(name, []).extend(whole)
    return collected


def _detections(source: RunSource, cell: CellLike, method: MethodLike) -> Iterator[DataFrame]:
    """The detections with the columns that the sums ask for, as far as they were stored."""
    wanted = {*NUMBERING, *PLACE_COLUMNS, *detection_columns(method)}
    first = next(source.frames("detections", cell.label, method.label), None)
    if first is None:
        return iter(())
    columns = [name for name in first.columns if name in wanted]
    return source.frames("detections", cell.label, method.label, columns=columns)


def _rule_tables(cell: CellLike, sums: RuleSums, n_fields: int, inputs: InputCounts) -> Parts:
    import pandas as pd

    area_deg2 = cell.region_deg2
    sums.counts.n_input[:] = inputs.n_input
    areas_deg2 = (area_deg2 * n_fields, area_deg2 * inputs.n_fields)
    parts: dict[str, list[Part]] = {}
    chance = float("nan") if sums.chance is None else sums.chance.of_lost_sources()
    for kind in sums.kinds():
        for name, found in _kind_tables(cell, sums.by_kind[kind], chance).items():
            parts.setdefault(name, []).extend(part.having(kind=kind) for part in found)
    weights = _field_weights(cell, n_field_groups(cell.realisations))
    lots = _field_weights(cell, n_field_groups(cell.realisations, MAX_GROUPS))
    whole = {
        "counts_differential": sums.counts.differential(*areas_deg2),
        "counts_integral": sums.counts.integral(*areas_deg2),
        "false_detections": pd.DataFrame([sums.statuses.false_row(n_fields, areas_deg2[0], weights)]),
        "status_counts": sums.statuses.table(n_fields, areas_deg2[0]),
        "chance_matches": pd.DataFrame() if sums.chance is None else sums.chance.table(),
        **sums.classes.tables(lots, areas_deg2[0]),
    }
    return parts | {name: [Part(rows, {})] for name, rows in whole.items()}


def _kind_tables(cell: CellLike, sums: KindSums, chance: float) -> Parts:
    """The tables that have rows for every kind of source. chance: of a lost source to be matched, NaN if not known."""
    import pandas as pd

    curves, limits, flux_limit_cgs = [], [], float("nan")
    for quantity, counts in sums.completeness.items():
        curve = counts.table(_resampling(cell, quantity))
        corrected = completeness_without_chance(curve["completeness"].to_numpy(np.float64), chance)
        curves.append(Part(curve, {"quantity": quantity, "completeness_corrected": corrected}))
        if not len(curve):
            continue
        for limit in counts.limits(_resampling(cell, quantity)):
            values = (limit.level, limit.value, limit.lower, limit.upper, limit.state)
            limits.append((quantity, *values))
            if quantity == FLUX_BINS.quantity and limit.level == HEADLINE_LEVEL:
                flux_limit_cgs = limit.value
    names = ["quantity", "level", "limit", "lower", "upper", "state"]
    return {
        "completeness": curves,
        "completeness_limit": [Part(pd.DataFrame(limits, columns=names), {})],
        "photometry": [Part(sums.photometry.table(flux_limit_cgs), {})],
        "astrometry": [Part(sums.astrometry.table(flux_limit_cgs), {})],
    }


def _resampling(cell: CellLike, quantity: str) -> np.random.Generator:
    """The same resampled fields for every method and rule of a cell."""
    return stream(f"{cell.label}/{quantity}", "resampled fields")


def _field_weights(cell: CellLike, n_groups: int) -> FloatArray:
    """How often each group of fields is drawn, the same for every method and rule of a cell."""
    return field_weights(n_groups, stream(cell.label, f"resampled fields, {n_groups}"))
