"""One measured quantity of the matched sources, summed for all bins and named subsets at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.stats.bins import FLUX_BINS, INPUT_COUNTS_BINS, LogBins
from survey_mc.stats.histograms import Histograms, Summary
from survey_mc.stats.selections import ABOVE_LIMIT, NAMED, counts_group, flux_group, named_groups
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame


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
    by_flux: Histograms = field(init=False)
    by_counts: Histograms = field(init=False)
    named: Histograms = field(init=False)

    def __post_init__(self) -> None:
        self.by_flux = Histograms(FLUX_BINS.size + 1, self.edges, self.is_log)
        self.by_counts = Histograms(INPUT_COUNTS_BINS.size + 1, self.edges, self.is_log)
        self.named = Histograms(len(NAMED), self.edges, self.is_log)

    def add(self, matched: DataFrame, values: FloatArray) -> None:
        """Add one value for each matched row; NaN is left out."""
        self.by_flux.add(flux_group(matched), values)
        self.by_counts.add(counts_group(matched), values)
        for group, belongs in enumerate(named_groups(matched)):
            self.named.add(np.where(belongs, group, -1), values)

    def parts(self, flux_limit_cgs: float = float("nan")) -> Iterator[Part]:
        """Occupied bins, occupied named subsets, and all flux bins that lie wholly above a flux limit (if finite)."""
        for group, name in enumerate(NAMED):
            summary = self.named.summary(slice(group, group + 1))
            if summary.n:
                yield Part(name, float("nan"), float("nan"), summary)
        if np.isfinite(flux_limit_cgs):
            above = np.append(FLUX_BINS.edges[:-1] >= flux_limit_cgs, True)
            first = float(FLUX_BINS.edges[:-1][above[:-1]][0]) if above[:-1].any() else FLUX_BINS.edges[-1]
            summary = self.by_flux.summary(above)
            if summary.n:
                yield Part(ABOVE_LIMIT, first, float("inf"), summary)
        yield from self._bin_parts("flux bin", self.by_flux, FLUX_BINS)
        yield from self._bin_parts("counts bin", self.by_counts, INPUT_COUNTS_BINS)

    @staticmethod
    def _bin_parts(name: str, histograms: Histograms, bins: LogBins) -> Iterator[Part]:
        edges = bins.edges
        for group in np.flatnonzero(histograms.counts[:-1].sum(axis=1)):
            yield Part(name, edges[group], edges[group + 1], histograms.summary(slice(group, group + 1)))
