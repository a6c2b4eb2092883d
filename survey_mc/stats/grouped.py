"""One measured quantity of the matched sources, summed for all bins and named subsets at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from survey_mc.stats.bins import FLUX_BINS, INPUT_COUNTS_BINS, LogBins
from survey_mc.stats.histograms import Histograms, Summary
from survey_mc.stats.selections import ABOVE_LIMIT, COUNTS_GROUPS, FLUX_GROUPS, NAMED, NAMED_GROUPS, Selections
from survey_mc.types import FloatArray


@dataclass(frozen=True, slots=True)
class Part:
    """A subset of the sources: its name ("flux bin", "counts bin" or a named one), its range and its sums."""

    selection: str
    lower_edge: float
    upper_edge: float
    summary: Summary


@dataclass(slots=True)
class GroupedValues:
    """Histograms of one quantity by flux bin, by input-count bin and by named subset."""

    edges: FloatArray
    is_log: bool
    sums: Histograms = field(init=False)

    def __post_init__(self) -> None:
        self.sums = Histograms(NAMED_GROUPS.stop, self.edges, self.is_log)

    def add(self, belongs: Selections, values: FloatArray) -> None:
        """Add one value for each matched row; NaN is left out."""
        self.sums.add(belongs.group, values, belongs.row)

    def parts(self, flux_limit_cgs: float = float("nan")) -> Iterator[Part]:
        """Occupied bins, occupied named subsets, and all flux bins that lie wholly above a flux limit (if finite)."""
        for group, name in zip(NAMED_GROUPS, NAMED, strict=True):
            summary = self.sums.summary(slice(group, group + 1))
            if summary.n:
                yield Part(name, float("nan"), float("nan"), summary)
        if np.isfinite(flux_limit_cgs):
            above = np.append(FLUX_BINS.edges[:-1] >= flux_limit_cgs, True)
            first = float(FLUX_BINS.edges[:-1][above[:-1]][0]) if above[:-1].any() else FLUX_BINS.edges[-1]
            summary = self.sums.summary(FLUX_GROUPS.start + np.flatnonzero(above))
            if summary.n:
                yield Part(ABOVE_LIMIT, first, float("inf"), summary)
        yield from self._bin_parts("flux bin", FLUX_GROUPS, FLUX_BINS)
        yield from self._bin_parts("counts bin", COUNTS_GROUPS, INPUT_COUNTS_BINS)

    def _bin_parts(self, name: str, groups: range, bins: LogBins) -> Iterator[Part]:
        edges = bins.edges
        for place in np.flatnonzero(self.sums.counts[groups.start : groups.stop - 1].any(axis=1)):
            group = groups.start + int(place)
            yield Part(name, edges[place], edges[place + 1], self.sums.summary(slice(group, group + 1)))
