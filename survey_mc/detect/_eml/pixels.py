"""The pixels that enter a fit, and accepted models on the background.

Idea     a fit sees the observed pixels within a radius of any of its sources; the model of an accepted source becomes
         background for the fainter ones, as far out as it matters.
Limits   unobserved pixels (exposure 0) never enter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from survey_mc.detect._eml.fit import X, Y
from survey_mc.detect._eml.kernels import add_to_background, contributions, pixels_near
from survey_mc.types import FloatArray, FloatImage


@dataclass(frozen=True, slots=True)
class Images:
    """What is fitted: counts, expected counts so far (grows with accepted sources) and relative exposure, float64."""

    counts: FloatImage
    background: FloatImage
    exposure: FloatImage


def parts_of(sources: FloatArray, pixels: FloatArray, table: FloatArray) -> FloatArray:
    """(n_sources, n_pixels) expected counts of each source in each pixel."""
    parts = np.empty((len(sources), pixels.shape[1]))
    contributions(sources, pixels, table, parts)
    return parts


def window(low: float, high: float, n_pix: int) -> slice:
    """Pixels from low to high, cut to 0 … n_pix − 1."""
    return slice(max(math.ceil(low), 0), min(math.floor(high) + 1, n_pix))


def collect(images: Images, sources: FloatArray, radius_pix: float) -> FloatArray:
    """(5, n) observed pixels within the radius of any source: x, y, counts, background, relative exposure."""
    room = min(len(sources) * (2 * math.ceil(radius_pix) + 1) ** 2, images.counts.size)
    pixels = np.empty((5, room))
    n = pixels_near(images.counts, images.background, images.exposure, sources, radius_pix, pixels)
    return pixels[:, :n].copy()


def observed_share(exposure: FloatImage, source: FloatArray, table: FloatArray, radius_pix: float) -> float:
    """Share of the source's model inside the radius that falls on observed pixels."""
    height, width = exposure.shape
    x, y = math.floor(source[X] + 0.5), math.floor(source[Y] + 0.5)
    reach = math.ceil(radius_pix)
    rows, columns = window(y - reach, y + reach, height), window(x - reach, x + reach, width)
    whole = rows.stop - rows.start == columns.stop - columns.start == 2 * reach + 1
    if whole and exposure[rows, columns].all():
        return 1.0
    offset = np.arange(-reach, reach + 1)
    pixels = np.ones((5, offset.size**2))
    pixels[0], pixels[1] = np.tile(x + offset, offset.size), np.repeat(y + offset, offset.size)
    near = np.hypot(pixels[0] - source[X], pixels[1] - source[Y]) <= radius_pix
    pixels = np.ascontiguousarray(pixels[:, near])
    model = parts_of(source[None], pixels, table)[0]
    column, row = pixels[:2].astype(np.int64)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    seen = exposure[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)] > 0.0
    return float(model[inside & seen].sum() / model.sum())


def add_model(images: Images, source: FloatArray, table: FloatArray, floor: float, sign: float = 1.0) -> None:
    """Add the source's model to the background (−1: take it away), as far as it is above `floor` counts per pixel."""
    add_to_background(images.background, images.exposure, source[None], table, floor, sign)
