"""Detection thresholds of the Mexican hat W(0) = 2 on a flat Poisson field.

Idea     the correlation C = W⋆D of a flat field has mean 0 and variance b ΣW². Its upper tail is either Freeman's fit
         to simulations or the exact distribution; both are tabulated in log b and interpolated.
Source   Freeman et al. 2002, ApJS 138, 185, App. B, with q = 2πσ²b counts in the kernel's effective area; exact: see
         `_shared.exact_threshold`.
Limits   Freeman's fit is 3–8 % above the exact threshold at tails of 1e-4, up to twice at q < 0.1, and 3 % below it
         near q = 10 where two branches join. The local background counts as known. Above σ = 4 pixels the kernel is
         so well sampled that only q matters (0.1 %): larger scales share one table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import ndtri

from survey_mc.caches import bounded_cache
from survey_mc.detect._shared.exact_threshold import filter_distribution, tail_crossing
from survey_mc.detect._shared.mexican_hat import mexican_hat
from survey_mc.types import FloatArray

ThresholdKind = Literal["freeman", "exact"]

WELL_SAMPLED_SIGMA_PIX = 4.0
EXACT_NODES_PER_OCTAVE = 2
FREEMAN_NODES_PER_OCTAVE = 32
MOST_COUNTS_TABULATED = 3e4  # under the kernel; beyond, the grid of values blurs the weights by more than 0.05 %
LOWEST_LOG2, HIGHEST_LOG2 = -20, 20  # of the background, counts per pixel
PRESELECTION = 0.9  # of the Gaussian threshold: Poisson thresholds and their fit are above it


def freeman_threshold(expected_counts: FloatArray, false_alarm: float) -> FloatArray:
    """C_t of q = 2πσ²b expected counts (> 0) (Freeman et al. 2002, App. B)."""
    tail = math.log10(false_alarm)
    log_q = np.log10(expected_counts)
    few = 0.00462 * log_q**2 + 0.0661 * log_q - 0.0154 * tail**2 - 0.252 * tail - 0.031
    if tail < -7.0:
        bend = 0.0
    elif tail <= -2.0:
        bend = 0.00085 * (tail + 7.0) ** 3.5
    else:
        bend = 0.00015 * (tail + 7.0) ** 4.75
    slope = 0.00182 * tail**3 + 0.0279 * tail**2 + 0.158 * tail + 0.607
    some = slope * log_q - 0.064 * tail + 0.612 - bend
    per_sigma = -0.509 * tail + 1.897 - (0.00172 * (tail + 7.0) ** 3.606 if tail >= -7.0 else 0.0)
    many = per_sigma * np.sqrt(expected_counts) - 1.115 * tail - 1.038
    return np.where(log_q < -0.5, 10.0**few, np.where(log_q < 1.0, 10.0 ** np.minimum(some, 99.0), many))


@bounded_cache(1024)
def exact_reduced_thresholds(sigma_pix: float, node: int, false_alarms: tuple[float, ...]) -> tuple[float, ...]:
    """C_t / √(b ΣW²) at b = 2^(node / EXACT_NODES_PER_OCTAVE) for each tail probability, one distribution for all."""
    kernel = mexican_hat(sigma_pix)
    background = 2.0 ** (node / EXACT_NODES_PER_OCTAVE)
    if background * kernel.size > MOST_COUNTS_TABULATED:
        return tuple(cornish_fisher(kernel, background, false_alarm) for false_alarm in false_alarms)
    values, tail = filter_distribution(kernel, background)
    noise = math.sqrt(background * np.square(kernel).sum())
    return tuple(tail_crossing(values, tail, false_alarm) / noise for false_alarm in false_alarms)


def cornish_fisher(kernel: FloatArray, background: float, false_alarm: float) -> float:
    """Quantile in standard deviations from the third and fourth cumulants; for many counts, where these are small."""
    k = -float(ndtri(false_alarm))
    noise = math.sqrt(background * np.square(kernel).sum())
    skewness = background * np.power(kernel, 3).sum() / noise**3
    excess = background * np.power(kernel, 4).sum() / noise**4
    return float(k + skewness * (k**2 - 1) / 6 + excess * (k**3 - 3 * k) / 24 - skewness**2 * (2 * k**3 - 5 * k) / 36)


@bounded_cache(256)
def _freeman_table(sigma_pix: float, false_alarm: float) -> tuple[FloatArray, FloatArray]:
    """log₂ b and C_t / √(b ΣW²) there."""
    log2_background = np.arange(LOWEST_LOG2, HIGHEST_LOG2, 1.0 / FREEMAN_NODES_PER_OCTAVE)
    background = 2.0**log2_background
    threshold = freeman_threshold(2.0 * np.pi * sigma_pix**2 * background, false_alarm)
    return log2_background, threshold / np.sqrt(background * np.square(mexican_hat(sigma_pix)).sum())


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Thresholds of one scale for the tails that will be asked for.

    least: no threshold is below this (correlation units, W(0) = 2 a photon).
    """

    kind: ThresholdKind
    sigma_pix: float
    false_alarms: tuple[float, ...]
    least: float = 0.0

    @property
    def norm(self) -> float:
        """√ΣW²: the standard deviation of C at one count per pixel."""
        return math.sqrt(np.square(mexican_hat(self.sigma_pix)).sum())

    def at(self, background: FloatArray, false_alarm: float) -> FloatArray:
        """C_t for backgrounds (counts per pixel, ≥ 0; 0 stands for the lowest tabulated)."""
        log2_background = np.log2(np.clip(background, 2.0**LOWEST_LOG2, 2.0 ** (HIGHEST_LOG2 - 1)))
        reduced = self._reduced(log2_background, false_alarm)
        return np.maximum(reduced * np.exp2(0.5 * log2_background) * self.norm, self.least)

    def certainly_above(self, false_alarm: float) -> float:
        """A lower bound of C_t / √b, to leave out most pixels cheaply."""
        return PRESELECTION * float(-ndtri(false_alarm)) * self.norm

    def _reduced(self, log2_background: FloatArray, false_alarm: float) -> FloatArray:
        if log2_background.size == 0:
            return log2_background
        if self.kind == "freeman":
            return np.interp(log2_background, *_freeman_table(self.sigma_pix, false_alarm))
        sampled = min(self.sigma_pix, WELL_SAMPLED_SIGMA_PIX)
        place = (log2_background + 2.0 * math.log2(self.sigma_pix / sampled)) * EXACT_NODES_PER_OCTAVE
        nodes = np.arange(math.floor(place.min()), math.ceil(place.max()) + 1)
        which = self.false_alarms.index(false_alarm)
        values = [exact_reduced_thresholds(sampled, int(node), self.false_alarms)[which] for node in nodes]
        return np.interp(place, nodes, values)
