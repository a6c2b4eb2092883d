"""Maxima of the Mexican-hat transform over scales, and the background they stand on.

Idea     at each scale the maxima of C′ above the threshold of their background are candidates; over the scales the one
         of largest C stands for its neighbours. Sources found so far are taken out, as Gaussians, of the image from
         which the next background is measured: at a scale those of that scale and smaller, so that what is larger
         counts as background. The first background is the exposure map scaled to all photons.
Source   ewavelet of the XMM-Newton SAS; Damiani et al. 1997, ApJ 483, 350; paper Sect. 3.3.
Limits   a candidate is known by its pixel; pixels with less than the least share of exposure are not searched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from survey_mc.detect._ewavelet.hat_ring import LEAST_COVERAGE, LEAST_RATE, ExposureResponse, HatRing, mean_rate
from survey_mc.detect._shared.convolution import Float32Image, Transform
from survey_mc.detect._shared.mexican_hat import mexican_hat
from survey_mc.types import FloatArray

ABOVE_ROUNDING = 1.0001  # photons_min photons alone must not be a source, whatever the transform rounds

FLOOR_SHARE = 0.8  # of the threshold on the lowest background: maxima below it need no look at their own background

Threshold = Callable[[FloatArray, float], FloatArray]
MergeRule = Literal["highest", "smallfirst"]


@dataclass(frozen=True, slots=True)
class Rules:
    """What counts as a source.

    scales_pix: σ of the hats; threshold(b, σ): least W⋆D (W(0) = 2) on b counts per pixel; photons_min: nor below the
    peak of that many photons in one pixel; edge_factor: W⋆D must exceed that of the background by it; radius: see
    `chosen_of_each`.
    """

    scales_pix: tuple[float, ...]
    threshold: Threshold
    photons_min: float
    edge_factor: float
    merge_rule: MergeRule
    radius: float


@dataclass(frozen=True, slots=True)
class Image:
    """counts and relative exposure (0 … 1), both 0 where not observed; not searched below the least exposure.

    filters, response: of the rules' scales, for this shape and this exposure.
    """

    counts: Float32Image
    exposure: Float32Image
    least_exposure: float
    filters: HatRing
    response: ExposureResponse


@dataclass(frozen=True, slots=True)
class Candidates:
    """Maxima above the threshold: pixel (n, 2) row and column, scale number, W⋆D corrected for the exposure."""

    pixel: NDArray[np.int64]
    scale: NDArray[np.int64]
    correlation: FloatArray

    def take(self, rows: NDArray[np.int64]) -> Candidates:
        """Some of them."""
        return Candidates(self.pixel[rows], self.scale[rows], self.correlation[rows])


@dataclass(frozen=True, slots=True)
class Found:
    """Sources, and of each scale the corrected transform (−∞ where not searched) and the background, counts per pixel.

    planes, backgrounds: (n_scales, ny, nx).
    """

    sources: Candidates
    planes: Float32Image
    backgrounds: Float32Image


def search(image: Image, rules: Rules, iterations: int, granted: Float32Image | None) -> Found:
    """Sources after `iterations` estimates of the background; granted: known background (counts per pixel) instead."""
    filters = image.filters
    transform = filters.convolver.image(image.counts)
    raw = tuple(filters.convolver.apply(transform, hat) for hat in filters.hats)
    # Both are written anew by every `find`: fresh megabytes each time would cost as much as the arithmetic.
    planes, backgrounds = (np.empty((len(raw), *image.counts.shape), np.float32) for _ in range(2))
    if granted is not None:
        rate = np.asarray(granted / np.maximum(image.exposure, LEAST_RATE), dtype=np.float32)
        return find(image, raw, [rate] * len(raw), rules, planes, backgrounds)
    flat = np.full(image.counts.shape, mean_rate(image.counts, image.exposure), dtype=np.float32)
    found = find(image, raw, [flat] * len(raw), rules, planes, backgrounds)
    for _ in range(iterations - 1):
        rates = residual_rates(image, found.sources, rules)
        found = find(image, raw, rates, rules, planes, backgrounds)
    return found


def residual_rates(image: Image, sources: Candidates, rules: Rules) -> list[Float32Image]:
    """Background rate of each scale from the image without the sources of that scale and smaller ones."""
    from survey_mc.detect._ewavelet.kernels import ring_rate  # numba: imported when it is first needed

    least = (LEAST_COVERAGE, LEAST_RATE)
    residual = image.counts
    transform: Transform = image.filters.convolver.image(residual)
    rates = []
    for number, ring in enumerate(image.filters.rings):
        here = sources.take(np.flatnonzero(sources.scale == number))
        if here.scale.size:
            gaussians = reconstruct(here, rules.scales_pix, residual.shape)
            residual = np.asarray(np.where(image.exposure > 0.0, residual - gaussians, 0.0), dtype=np.float32)
            transform = image.filters.convolver.image(residual)
        around = image.filters.convolver.apply(transform, ring)
        rates.append(ring_rate(around, image.response.rings[number], least, mean_rate(residual, image.exposure)))
    return rates


def reconstruct(sources: Candidates, scales_pix: tuple[float, ...], shape: tuple[int, ...]) -> Float32Image:
    """Gaussians as wide as the scale of each source, with 4πσ²C counts."""
    from survey_mc.detect._ewavelet.kernels import paint_gaussians

    image = np.zeros(shape, dtype=np.float32)
    y_pix, x_pix = np.ascontiguousarray(sources.pixel.T, dtype=np.float64)
    paint_gaussians(x_pix, y_pix, 2.0 * sources.correlation, np.array(scales_pix)[sources.scale], image)
    return image


def find(
    image: Image,
    raw: tuple[Float32Image, ...],
    rates: list[Float32Image],
    rules: Rules,
    planes: Float32Image,
    backgrounds: Float32Image,
) -> Found:
    """Sources on a given background rate of each scale; raw: W⋆D; planes, backgrounds: (n_scales, ny, nx), filled."""
    from survey_mc.detect._ewavelet.kernels import corrected

    parts = []
    for number, sigma in enumerate(rules.scales_pix):
        plane, background = planes[number], backgrounds[number]
        response = image.response.hats[number]
        corrected(raw[number], response, rates[number], image.exposure, image.least_exposure, plane, background)
        pixel = maxima(plane, raw[number], background, sigma, rules)
        parts.append((pixel, np.full(len(pixel), number), plane[pixel[:, 0], pixel[:, 1]].astype(np.float64)))
    pixel, scale, correlation = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Found(merge(Candidates(pixel, scale, correlation), rules), planes, backgrounds)


def maxima(
    plane: Float32Image, raw: Float32Image, background: Float32Image, sigma: float, rules: Rules
) -> NDArray[np.int64]:
    """(n, 2) pixels of the significant maxima of one scale."""
    from survey_mc.detect._ewavelet.kernels import hat_at
    from survey_mc.detect._ewavelet.local_maxima import local_maxima

    hat = mexican_hat(sigma)
    photons = rules.photons_min * hat.max() * ABOVE_ROUNDING
    cheapest = rules.threshold(np.maximum(background.min(keepdims=True)[0].astype(np.float64), LEAST_RATE), sigma)[0]
    pixel: NDArray[np.int64] = local_maxima(plane, np.float32(max(photons, FLOOR_SHARE * cheapest)))
    level = np.maximum(background[pixel[:, 0], pixel[:, 1]].astype(np.float64), LEAST_RATE)
    pixel = pixel[plane[pixel[:, 0], pixel[:, 1]] > rules.threshold(level, sigma)]
    # Structure of the background itself: what the correction for the exposure alone has not removed.
    structure = hat_at(background, pixel, hat.astype(np.float32))
    return np.asarray(pixel[raw[pixel[:, 0], pixel[:, 1]] > rules.edge_factor * structure])


def merge(candidates: Candidates, rules: Rules) -> Candidates:
    """The candidates that stand for themselves: of largest C, or of the smallest scale."""
    from survey_mc.detect._ewavelet.kernels import chosen_of_each

    sigma = np.array(rules.scales_pix)[candidates.scale]
    falling = -candidates.correlation / np.square(sigma)
    first = np.zeros(len(sigma)) if rules.merge_rule == "highest" else sigma
    order = np.lexsort((candidates.pixel[:, 1], candidates.pixel[:, 0], sigma, falling, first))
    ordered = candidates.take(order)
    y_pix, x_pix = np.ascontiguousarray(ordered.pixel.T, dtype=np.float64)
    owner = chosen_of_each(x_pix, y_pix, sigma[order], rules.radius)
    return ordered.take(np.flatnonzero(owner == np.arange(len(owner))))
