"""Completeness: of the true sources in a bin, the fraction that was found.

Idea     N(found)/N(true) in bins of an *input* quantity; sources in scope are the matched and the missed ones. The 90 %
         limit is read from the completeness made monotonic; its error comes from resampling whole fields.
Source   Valtchanov et al. 2001, Sect. 8 and Fig. "detection rate"; isotonic regression: Barlow et al. 1972.
Limits   the input list is cut in counts: near the cut a flux bin holds only its less vignetted sources. Sources of one
         field share background and blends, so the binomial interval is too short by √design_effect.

Memory: one pair of small integers for each (group of fields, bin), see `resampling`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.bins import LogBins
from survey_mc.stats.intervals import CLAIM, clopper_pearson, jeffreys
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.resampling import (
    N_RESAMPLES,
    TAIL,
    design_effect,
    field_weights,
    inner_quantiles,
    n_field_groups,
    resampled_sums,
)
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

LEVELS = (0.5, 0.8, 0.9)
ROUNDING = 1e-12  # a completeness this little below a level has reached it


@dataclass(frozen=True, slots=True)
class Limit:
    """Value of the binned quantity at which the completeness reaches `level`; NaN unless `state` is "reached".

    state: reached, not reached (even the brightest are less complete) or below range (even the faintest are more).
    lower, upper: one-sigma interval from resampled fields, 0 and inf where open; NaN with fewer than two fields.
    """

    level: float
    value: float
    lower: float
    upper: float
    state: str


@dataclass(slots=True)
class CompletenessCounts:
    """Found and true sources of one rule, by field group and bin."""

    bins: LogBins
    n_fields: int
    n_true: NDArray[np.int32] = field(init=False)
    n_found: NDArray[np.int32] = field(init=False)
    sum_log: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        shape = (n_field_groups(self.n_fields), self.bins.size)
        self.n_true = np.zeros(shape, dtype=np.int32)
        self.n_found = np.zeros(shape, dtype=np.int32)
        self.sum_log = np.zeros(self.bins.size)

    def add(self, matches: DataFrame | MatchRows) -> None:
        """Add rows of one rule; only `matched` and `missed` count."""
        rows = MatchRows.of(matches)
        rows = rows.where(rows.has("status", "matched", "missed"))
        values = rows.numbers(self.bins.quantity)
        place = self.bins.index(values)
        keep = (place >= 0) & (place < self.bins.size)
        place = place[keep]
        cell = rows.integers("realisation")[keep] % len(self.n_true) * self.bins.size + place
        np.add.at(self.n_true.reshape(-1), cell, np.int32(1))
        np.add.at(self.n_found.reshape(-1), cell[rows.has("status", "matched")[keep]], np.int32(1))
        self.sum_log += np.bincount(place, weights=np.log10(values[keep]), minlength=self.bins.size)

    def table(self, rng: np.random.Generator, n_resamples: int = N_RESAMPLES) -> DataFrame:
        """Occupied bins: lower_edge, upper_edge, centre (geometric mean of the sources), n_true, n_found, completeness,
        lower, upper (Jeffreys), lower_fields, upper_fields (resampled fields), lower_cp, upper_cp (Clopper–Pearson,
        95 %, for claims), design_effect.
        """
        import pandas as pd

        n_true, n_found = self.n_true.sum(axis=0, dtype=np.int64), self.n_found.sum(axis=0, dtype=np.int64)
        used = n_true > 0
        true_again, found_again = self._resample(rng, n_resamples)
        lower, upper = jeffreys(n_found, n_true)
        with np.errstate(divide="ignore", invalid="ignore"):
            again = found_again / true_again
            completeness = n_found / n_true
            centre = 10.0 ** (self.sum_log / n_true)
        fields = inner_quantiles(again[:, used])
        claims = clopper_pearson(n_found[used], n_true[used], CLAIM)
        return pd.DataFrame(
            {
                "lower_edge": self.bins.edges[:-1][used],
                "upper_edge": self.bins.edges[1:][used],
                "centre": centre[used],
                "n_true": n_true[used],
                "n_found": n_found[used],
                "completeness": completeness[used],
                "lower": lower[used],
                "upper": upper[used],
                "lower_fields": fields[0],
                "upper_fields": fields[1],
                "lower_cp": claims[0],
                "upper_cp": claims[1],
                "design_effect": design_effect(self.n_found, self.n_true)[used],
            }
        )

    def limits(self, rng: np.random.Generator, n_resamples: int = N_RESAMPLES) -> tuple[Limit, ...]:
        """The limits at `LEVELS`, with intervals from resampled fields."""
        n_true, n_found = self.n_true.sum(axis=0, dtype=np.int64), self.n_found.sum(axis=0, dtype=np.int64)
        used = n_true > 0
        log_centre = self.sum_log[used] / n_true[used]
        true_again, found_again = self._resample(rng, n_resamples)
        if not used.any():
            return tuple(Limit(level, np.nan, np.nan, np.nan, "not reached") for level in LEVELS)
        best = crossings(log_centre, n_found[used], n_true[used])
        again = crossings(log_centre, found_again[:, used], true_again[:, used])
        limits = []
        for i, level in enumerate(LEVELS):
            lower, upper = np.full(2, np.nan)
            if len(again):
                spread = np.sort(again[:, i])
                lower, upper = (spread[round(q * (len(spread) - 1))] for q in (TAIL, 1.0 - TAIL))
            state = {-np.inf: "below range", np.inf: "not reached"}.get(best[i], "reached")
            value = 10.0 ** best[i] if state == "reached" else np.nan
            limits.append(Limit(level, float(value), float(10.0**lower), float(10.0**upper), state))
        return tuple(limits)

    def _resample(self, rng: np.random.Generator, n_resamples: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(n_resamples, bins) true and found sources of resampled fields; no rows with fewer than two fields."""
        weights = field_weights(len(self.n_true), rng, n_resamples)
        return resampled_sums(weights, self.n_true), resampled_sums(weights, self.n_found)


def crossings(log_centre: FloatArray, n_found: NDArray[np.int64], n_true: NDArray[np.int64]) -> FloatArray:
    """log10 of the quantity where the completeness passes each of `LEVELS`.

    log_centre: (bins,). n_found, n_true: (…, bins), one set of numbers or many; result: (…, levels). The completeness
    is made non-decreasing by isotonic regression weighted with n_true, then interpolated linearly between the centres
    of the bins with sources. −inf: above the level from the first of them on; +inf: below it in the last.
    """
    used = n_true > 0
    rising = np.where(used, rising_fractions(n_found, n_true), -np.inf)
    place = np.where(used, np.arange(n_true.shape[-1]), -1)
    before = np.concatenate((np.full((*place.shape[:-1], 1), -1), np.maximum.accumulate(place, axis=-1)[..., :-1]), -1)

    def at(values: FloatArray, index: NDArray[np.int64]) -> FloatArray:
        return np.asarray(np.take_along_axis(values, np.maximum(index, 0)[..., None], axis=-1)[..., 0])

    x = np.broadcast_to(log_centre, n_true.shape)
    result = np.empty((*n_true.shape[:-1], len(LEVELS)))
    for i, level in enumerate(LEVELS):
        reached = rising >= level - ROUNDING
        first = np.argmax(reached, axis=-1)
        last_below = at(before, first).astype(np.int64)
        low, high = at(rising, last_below), at(rising, first)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside = at(x, last_below) + (level - low) / (high - low) * (at(x, first) - at(x, last_below))
        result[..., i] = np.where(last_below < 0, -np.inf, inside)
        result[~reached.any(axis=-1), i] = np.inf
    return result


def rising_fractions(n_found: NDArray[np.int64], n_true: NDArray[np.int64]) -> FloatArray:
    """Isotonic regression of n_found / n_true with weights n_true along the last axis; n_true = 0 has no say.

    By its max-min form, max over a ≤ i of min over b ≥ i of the fraction of all sources in the bins a … b: many
    resamples at once, 50 times faster than one after the other. Bins without sources are not defined.
    """
    size = n_true.shape[-1]
    found, true = (np.concatenate((np.zeros((*n.shape[:-1], 1)), np.cumsum(n, axis=-1)), -1) for n in (n_found, n_true))
    result = np.full(n_true.shape, -np.inf)
    for a in range(size):  # fractions of a … b for every b ≥ a
        tried = true[..., a + 1 :] - true[..., a : a + 1]
        hits = found[..., a + 1 :] - found[..., a : a + 1]
        fraction = np.divide(hits, tried, out=np.full(hits.shape, np.inf), where=tried > 0)
        least = np.minimum.accumulate(fraction[..., ::-1], axis=-1)[..., ::-1]
        least = np.where(np.isinf(least), -np.inf, least)
        np.maximum(result[..., a:], least, out=result[..., a:])
    return result
