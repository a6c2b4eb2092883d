"""Logarithmic bins with fixed edges, the same for every run: sums of different runs can be added.

Limits   a value below the first edge, zero, negative or NaN has no bin; one above the last edge goes to `overflow`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from survey_mc.types import FloatArray

BINS_PER_DECADE = 10


@dataclass(frozen=True, slots=True)
class LogBins:
    """Bins of equal width in log10 over whole decades: 10**first_decade … 10**last_decade."""

    quantity: str
    first_decade: int
    last_decade: int
    per_decade: int = BINS_PER_DECADE

    @property
    def size(self) -> int:
        return (self.last_decade - self.first_decade) * self.per_decade

    @property
    def edges(self) -> FloatArray:
        """(size + 1,) edges, rounded to 12 digits so that 1e-15 is an edge and not its neighbour."""
        return _edges(self)

    def index(self, values: FloatArray) -> NDArray[np.int64]:
        """Bin of each value, lower edges included; −1 below or not a number, `size` at or above the last edge."""
        place = np.searchsorted(self.edges, values, side="right") - 1
        return np.where(np.isnan(values), -1, place).astype(np.int64)

    def count(self, values: FloatArray) -> NDArray[np.int64]:
        """(size + 1,) numbers of values in each bin, the overflow last."""
        place = self.index(values)
        return np.bincount(place[place >= 0], minlength=self.size + 1).astype(np.int64)


@lru_cache
def _edges(bins: LogBins) -> FloatArray:
    exponents = bins.first_decade + np.arange(bins.size + 1) / bins.per_decade
    edges = np.array([float(f"{10.0**e:.11e}") for e in exponents])
    edges.setflags(write=False)
    return edges


FLUX_BINS = LogBins("flux_true_cgs", -17, -11)
COUNTS_BINS = LogBins("counts_expected", 0, 5)
INPUT_COUNTS_BINS = LogBins("counts_onaxis", 0, 5)
