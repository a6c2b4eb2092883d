"""Counts, extent, position and their errors from the planes of a wavelet transform.

Idea     every source is taken for a Gaussian: counts 4πσ²C at its scale, width from C there and at the neighbouring
         scale, position from parabolas through the maximum, errors from the photon noise of such a source.
Source   ewavelet of the XMM-Newton SAS; Damiani et al. 1997, ApJ 483, 350.
Limits   the PSF is not taken out of the extent; wings wider than a Gaussian's make the counts grow with the scale.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.detect._ewavelet import gaussian_source as gaussian
from survey_mc.detect._ewavelet.damiani_threshold import equivalent_sigma
from survey_mc.detect._ewavelet.gaussian_source import PI
from survey_mc.detect._ewavelet.search import Found
from survey_mc.detect._shared.convolution import Float32Image
from survey_mc.types import BoolArray, FloatArray

WIDEST = 2.0  # largest width, in units of the larger scale, that a pair of scales can tell from a slope of background


@dataclass(frozen=True, slots=True)
class Measured:
    """Per source: position (pix) with error along one axis, whether it was interpolated along both axes, 4πσ²C with
    error, width σ′ with error (pix; NaN where no Gaussian fits), C, scale (pix), background (counts per pixel), and the
    significance (sigma) at its scale or a neighbouring one, whichever is larger."""

    x_pix: FloatArray
    y_pix: FloatArray
    position_err_pix: FloatArray
    interpolated: BoolArray
    counts: FloatArray
    counts_err: FloatArray
    width_pix: FloatArray
    width_err_pix: FloatArray
    correlation: FloatArray
    scale_pix: FloatArray
    background_per_pix: FloatArray
    significance: FloatArray


def measure(found: Found, scales_pix: tuple[float, ...]) -> Measured:
    """Everything about the sources of a search."""
    scales = np.array(scales_pix)
    at = found.sources.pixel[:, 0], found.sources.pixel[:, 1]
    number = found.sources.scale
    hat_answers = found.planes[:, at[0], at[1]].astype(np.float64)
    levels = found.backgrounds[:, at[0], at[1]].astype(np.float64)
    here = number, np.arange(len(number))
    sigma, background = scales[number], levels[here]
    correlation = hat_answers[here] / (2.0 * PI * sigma**2)
    width, width_err = extent(hat_answers, background, number, scales)
    counts = gaussian.counts_at_scale(correlation, sigma)
    assumed = np.where(np.isnan(width), sigma, width)
    model = correlation / gaussian.peak_correlation(np.ones(len(sigma)), assumed, sigma)
    variance = gaussian.correlation_variance(model, assumed, background, sigma)
    dx, dy, interpolated = parabola_offsets(found.planes, number, at)
    scatter = np.square(correlation * gaussian.pixel_scatter(assumed, sigma))
    return Measured(
        at[1] + gaussian.peak_offset(dx, assumed, sigma),
        at[0] + gaussian.peak_offset(dy, assumed, sigma),
        gaussian.position_error(model, assumed, background, sigma),
        interpolated,
        counts,
        gaussian.counts_at_scale(np.sqrt(variance + scatter), sigma),
        width,
        width_err,
        correlation,
        sigma,
        background,
        best_significance(hat_answers, levels, number, scales),
    )


def best_significance(
    hat_answers: FloatArray, levels: FloatArray, number: NDArray[np.int64], scales: FloatArray
) -> FloatArray:
    """Largest equivalent k of the scale of each source and its two neighbours.

    hat_answers, levels: (n_scales, n) W⋆D and background at each source. A point source can have its largest C at a
    scale whose noise is not the smallest; farther scales belong to other sources.
    """
    k_sigma = equivalent_sigma(hat_answers, levels, scales[:, None])
    neighbour = np.abs(np.arange(len(scales))[:, None] - number) <= 1
    return np.asarray(np.max(np.where(neighbour, k_sigma, 0.0), axis=0, initial=0.0))


def extent(
    hat_answers: FloatArray, background: FloatArray, number: NDArray[np.int64], scales: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Width σ′ (pix) and its error from the scale of each source and the better measured of its neighbours, or NaN."""
    n = len(number)
    if len(scales) == 1 or n == 0:
        return np.full(n, np.nan), np.full(n, np.nan)
    source = np.arange(n)
    signal = hat_answers / scales[:, None]  # noise of W⋆D grows as σ
    below, above = np.maximum(number - 1, 0), np.minimum(number + 1, len(scales) - 1)
    below_better = signal[below, source] > signal[above, source]
    other = np.where(above == number, below, np.where((below == number) | ~below_better, above, below))
    small, large = np.minimum(number, other), np.maximum(number, other)
    sigma1, sigma2 = scales[small], scales[large]
    c1 = hat_answers[small, source] / (2.0 * PI * sigma1**2)
    c2 = hat_answers[large, source] / (2.0 * PI * sigma2**2)
    width = gaussian.width_from_scales(c1, sigma1, c2, sigma2)
    width = np.where(width <= WIDEST * sigma2, width, np.nan)
    seen = ~np.isnan(width)
    assumed = np.where(seen, width, sigma1)
    counts = np.maximum(c1, 0.0) / gaussian.peak_correlation(np.ones(n), assumed, sigma1)
    counts = np.where(seen, counts, 1.0)
    error = gaussian.width_error(counts, assumed, background, sigma1, sigma2)
    return width, np.where(seen, error, np.nan)


def parabola_offsets(
    planes: Float32Image, number: NDArray[np.int64], at: tuple[NDArray[np.int64], NDArray[np.int64]]
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Offsets (pix, within ±½) of the parabolas from the maximum's pixel along x and y; where both could be laid."""
    row, column = at
    _, height, width = planes.shape
    inside = (row > 0) & (row < height - 1) & (column > 0) & (column < width - 1)
    y, x = np.clip(row, 1, height - 2), np.clip(column, 1, width - 2)
    offsets = []
    whole = inside
    for step_y, step_x in ((0, 1), (1, 0)):
        values = np.array([planes[number, y + k * step_y, x + k * step_x] for k in (-1, 0, 1)], dtype=np.float64)
        finite = inside & np.all(np.isfinite(values), axis=0)
        before, middle, after = np.where(finite, values, 0.0)
        bend = 2.0 * middle - before - after
        offsets.append(np.divide(0.5 * (after - before), bend, out=np.zeros(len(row)), where=bend > 0.0))
        whole = whole & finite
    return offsets[0], offsets[1], whole
