"""Means, spreads and quantiles of groups of values that never are in memory together.

Idea     for every group exact sums (n, Σx, Σx²) and a fine histogram with fixed edges; quantiles are read from it,
         linearly inside a bin. Adding the histograms of groups gives the histogram of their union.
Limits   a quantile is uncertain by less than one bin width; values beyond the ends count in the end bins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from survey_mc.stats.intervals import ONE_SIGMA
from survey_mc.types import FloatArray


@dataclass(slots=True)
class Histograms:
    """Sums of `n_groups` groups. edges: (m + 1,) ascending; is_log: quantiles interpolate in the logarithm."""

    n_groups: int
    edges: FloatArray
    is_log: bool = False
    counts: NDArray[np.int32] = field(init=False)
    total: FloatArray = field(init=False)
    total_of_squares: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.counts = np.zeros((self.n_groups, len(self.edges) - 1), dtype=np.int32)
        self.total = np.zeros(self.n_groups)
        self.total_of_squares = np.zeros(self.n_groups)

    def add(self, group: NDArray[np.int64], values: FloatArray, row: NDArray[np.int64] | None = None) -> None:
        """Add finite values to their groups; a group outside 0 … n_groups − 1 is ignored.

        row: (k,) which of the values each group is of; None: they are in the same order.
        """
        place = np.clip(np.searchsorted(self.edges, values, side="right") - 1, 0, len(self.edges) - 2)
        is_finite = np.isfinite(values)
        if row is not None:
            values, place, is_finite = values[row], place[row], is_finite[row]
        keep = (group >= 0) & (group < self.n_groups) & is_finite
        group, values, place = group[keep], values[keep], place[keep]
        np.add.at(self.counts.reshape(-1), group * self.counts.shape[1] + place, np.int32(1))
        self.total += np.bincount(group, weights=values, minlength=self.n_groups)
        self.total_of_squares += np.bincount(group, weights=values**2, minlength=self.n_groups)

    def summary(self, members: NDArray[np.int64] | slice) -> Summary:
        """What is known of the union of some groups."""
        return Summary(
            np.concatenate(([0], np.cumsum(self.counts[members].sum(axis=0, dtype=np.int64)))),
            float(self.total[members].sum()),
            float(self.total_of_squares[members].sum()),
            self.edges,
            self.is_log,
        )


@dataclass(frozen=True, slots=True)
class Summary:
    """Sums over one set of values; everything it gives is NaN when there are too few of them.

    below: (m + 1,) values below each edge of the histogram.
    """

    below: NDArray[np.int64]
    total: float
    total_of_squares: float
    edges: FloatArray
    is_log: bool

    @property
    def n(self) -> int:
        return int(self.below[-1])

    @property
    def mean(self) -> float:
        return self.total / self.n if self.n else float("nan")

    @property
    def rms(self) -> float:
        return float(np.sqrt(self.total_of_squares / self.n)) if self.n else float("nan")

    @property
    def stdev(self) -> float:
        """Sample standard deviation (n − 1)."""
        if self.n < 2:
            return float("nan")
        spread = self.total_of_squares - self.total**2 / self.n
        return float(np.sqrt(max(spread, 0.0) / (self.n - 1)))

    @property
    def mean_err(self) -> float:
        """Standard error of the mean."""
        return self.stdev / float(np.sqrt(self.n)) if self.n else float("nan")

    def quantile(self, fraction: float) -> float:
        """Value below which a fraction of the values lies."""
        return float(self._quantiles(np.array([fraction]))[0])

    def quantile_interval(self, fraction: float, confidence: float = ONE_SIGMA) -> tuple[float, float]:
        """Interval of a quantile from the binomial spread of its rank (any distribution)."""
        _, lower, upper = self.quantiles_with_intervals((fraction,), confidence)[0]
        return float(lower), float(upper)

    def quantiles_with_intervals(self, fractions: Sequence[float], confidence: float = ONE_SIGMA) -> FloatArray:
        """(k, 3) quantile, lower and upper end of each fraction; the ends as in `quantile_interval`."""
        wanted = np.asarray(fractions, dtype=np.float64)
        half = float(ndtri(0.5 + confidence / 2.0)) * np.sqrt(wanted * (1.0 - wanted) / max(self.n, 1))
        return self._quantiles(np.stack((wanted, wanted - half, wanted + half), axis=-1))

    def _quantiles(self, fractions: FloatArray) -> FloatArray:
        """The quantile of each fraction; all NaN when there are no values."""
        if not self.n:
            return np.full(fractions.shape, np.nan)
        wanted = np.clip(fractions, 0.0, 1.0) * self.n
        place = np.searchsorted(self.below, wanted, side="left") - 1
        first_with_any = int(np.searchsorted(self.below, 0, side="right")) - 1
        place = np.maximum(place, first_with_any)  # rank 0 is the lower edge of the first bin with anything
        inside = (wanted - self.below[place]) / (self.below[place + 1] - self.below[place])
        first, last = self.edges[place], self.edges[place + 1]
        if self.is_log:
            first, last = np.log(first), np.log(last)
        value = first + inside * (last - first)
        return np.asarray(np.exp(value) if self.is_log else value, dtype=np.float64)
