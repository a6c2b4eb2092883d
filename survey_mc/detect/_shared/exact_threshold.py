"""Exact false-alarm threshold of a linear filter on a flat Poisson field.

Idea     c = Σ wᵢ nᵢ with independent Poisson nᵢ of mean b is a compound Poisson variable: its characteristic function
         is exp(b Σᵢ (e^{itwᵢ} − 1)), so one FFT of the histogram of the weights gives its whole distribution.
Source   characteristic function of a compound Poisson sum (textbook); no Gaussian or Monte-Carlo step.
Limits   double precision: tails below ~1e-12 are rounding noise. A flat field: use the local b where it varies.
"""

from __future__ import annotations

import math

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.types import FloatArray

GRID_BINS = 2**16
STD_SPAN = 14.0  # half-range of the value grid, in standard deviations …
WEIGHT_SPAN = 20.0  # … plus this many times the largest weight, for skewed low-count fields
SMALLEST_TAIL = 1e-12
BACKGROUND_STEPS_PER_OCTAVE = 4  # thresholds are tabulated at b = 2^(k/4) and interpolated


def split_histogram(values: FloatArray, amounts: FloatArray, step: float, n_bins: int) -> FloatArray:
    """Histogram on the periodic grid k·step (k = 0 … n_bins−1; negative values wrap around).

    Each amount is shared linearly between the two grid points next to its value, which keeps the mean exactly.
    """
    place = values / step
    low = np.floor(place).astype(np.int64)
    high_share = place - low
    histogram = np.bincount(low % n_bins, amounts * (1.0 - high_share), n_bins)
    histogram += np.bincount((low + 1) % n_bins, amounts * high_share, n_bins)
    return np.asarray(histogram, dtype=np.float64)


def tail_crossing(values: FloatArray, tail: FloatArray, probability: float) -> float:
    """Value at which the upper tail falls to `probability`.

    values: ascending, equally spaced; tail: probability of each value or above. The mass of a grid point is taken as
    spread over its step, so the tail belongs to the lower edge of the step.
    """
    after = int(np.argmax(tail <= probability))
    share = (tail[after - 1] - probability) / (tail[after - 1] - tail[after]) if after else 0.0
    step = values[1] - values[0]
    return float(values[max(after - 1, 0)] + (share - 0.5) * step)


def filter_distribution(weights: FloatArray, background_per_pix: float) -> tuple[FloatArray, FloatArray]:
    """Values of Σ wᵢ nᵢ (ascending) and the probability of being at or above each.

    weights: kernel, any shape. background_per_pix: mean counts per pixel, > 0.
    """
    kernel = np.asarray(weights, dtype=np.float64).ravel()
    mean = background_per_pix * kernel.sum()
    span = STD_SPAN * math.sqrt(background_per_pix * np.square(kernel).sum()) + WEIGHT_SPAN * np.abs(kernel).max()
    step = 2.0 * span / GRID_BINS
    expected = split_histogram(kernel, np.full(kernel.size, background_per_pix), step, GRID_BINS)
    transform = np.fft.rfft(expected)
    probability = np.fft.irfft(np.exp(transform - expected.sum()), GRID_BINS)
    first = math.floor((mean - span) / step)
    ordered = np.clip(np.roll(probability, -(first % GRID_BINS)), 0.0, None)
    values = (first + np.arange(GRID_BINS)) * step
    return values, np.cumsum(ordered[::-1])[::-1]


def filter_tail(weights: FloatArray, background_per_pix: float, threshold: float) -> float:
    """Probability that the filtered flat field is at or above `threshold` in one pixel."""
    values, tail = filter_distribution(weights, background_per_pix)
    return float(np.interp(threshold, values - 0.5 * (values[1] - values[0]), tail))


def filter_threshold(weights: FloatArray, background_per_pix: float, false_alarm: float) -> float:
    """Smallest filtered value whose upper-tail probability is at most `false_alarm` (per pixel, one-sided)."""
    if false_alarm < SMALLEST_TAIL:
        raise ValueError(f"false_alarm must be at least {SMALLEST_TAIL:g} (got {false_alarm:g})")
    values, tail = filter_distribution(weights, background_per_pix)
    return tail_crossing(values, tail, false_alarm)


@bounded_cache(8)
def _one_copy(kernel: bytes) -> bytes:
    """The same bytes, as one object: as keys of the table below, equal kernels of megabytes would add up."""
    return kernel


@bounded_cache(1024)
def _reduced_threshold(kernel: bytes, octave_step: int, false_alarm: float) -> float:
    """(threshold − mean) / standard deviation at b = 2^(octave_step / BACKGROUND_STEPS_PER_OCTAVE)."""
    weights = np.frombuffer(kernel, dtype=np.float64)
    background = 2.0 ** (octave_step / BACKGROUND_STEPS_PER_OCTAVE)
    excess = filter_threshold(weights, background, false_alarm) - background * weights.sum()
    return float(excess / math.sqrt(background * np.square(weights).sum()))


def excess_threshold_map(weights: FloatArray, background_per_pix: FloatArray, false_alarm: float) -> FloatArray:
    """Exact threshold above the mean for every pixel of a smoothly varying background (counts per pixel, > 0).

    The threshold in units of the local standard deviation is interpolated in log₂ b between tabulated backgrounds.
    """
    kernel = np.ascontiguousarray(weights, dtype=np.float64).ravel()
    key = _one_copy(kernel.tobytes())
    place = np.log2(background_per_pix) * BACKGROUND_STEPS_PER_OCTAVE
    steps = np.arange(math.floor(place.min()), math.ceil(place.max()) + 1)
    reduced = np.array([_reduced_threshold(key, int(k), false_alarm) for k in steps])
    norm = math.sqrt(np.square(kernel).sum())
    return np.asarray(np.interp(place, steps, reduced) * np.sqrt(background_per_pix) * norm, dtype=np.float64)
