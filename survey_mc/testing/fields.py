"""Fields to try a procedure on: a flat Poisson sky, and photons of point sources at places that are known.

Idea     photons are drawn one by one with their exact positions; the image is their histogram. So a field can be
         shifted, turned or shuffled photon by photon, and any difference in the answer is the procedure's.
Source   King profile of FWHM 6″ and HEW 15″ (paper Tab. 1).
Limits   points only; the background follows the exposure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from survey_mc.telescope.psf import KingPsf
from survey_mc.types import Band, FloatArray, FloatImage, Observation, PixelGrid

PSF = KingPsf.from_fwhm_hew(6.0, 15.0)
SCALE_ARCSEC = 4.0
EXPOSURE_S = 1e4
BACKGROUND_PER_PIX = 0.178  # 10 ks, soft band
DEEP_BACKGROUND_PER_PIX = 1.78  # 100 ks
BAND = Band("soft", 0.5, 2.0, 6.70e-13)
SHAPE = (240, 288)  # (ny, nx); not square, so that a swap of the axes shows


@dataclass(frozen=True, slots=True)
class Drawn:
    """A field and its sources: (n, 2) positions in pixels, (n,) expected counts at full exposure."""

    observation: Observation
    positions: FloatArray
    counts: FloatArray


def lattice(rng: np.random.Generator, columns: int, rows: int, shape: tuple[int, int] = SHAPE) -> FloatArray:
    """(columns · rows, 2) positions on a regular grid, each somewhere in its pixel."""
    x = (np.arange(columns) + 0.5) * shape[1] / columns
    y = (np.arange(rows) + 0.5) * shape[0] / rows
    at = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return np.asarray(np.rint(at) + rng.uniform(-0.5, 0.5, at.shape))


def draw(
    rng: np.random.Generator,
    positions: FloatArray,
    counts: FloatArray,
    *,
    background_per_pix: float = BACKGROUND_PER_PIX,
    share: FloatImage | None = None,
    shape: tuple[int, int] = SHAPE,
    grants_background: bool = False,
) -> Drawn:
    """A field with these sources; share: exposure relative to the full one (vignetting and masks), 1 unless given."""
    seen = np.ones(shape) if share is None else share
    photons = [_background_photons(rng, background_per_pix * seen)]
    for place, number in zip(positions, rng.poisson(counts), strict=True):
        radius_pix = PSF.radius_of_fraction(rng.random(number)) / SCALE_ARCSEC
        angle = rng.uniform(0.0, 2.0 * np.pi, number)
        fallen = place + radius_pix[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        kept = rng.random(number) < _share_at(seen, fallen)
        photons.append(fallen[kept])
    granted = background_per_pix * seen if grants_background else None
    observation = observe(np.concatenate(photons), EXPOSURE_S * seen, granted)
    return Drawn(observation, positions, counts)


def _background_photons(rng: np.random.Generator, expected: FloatImage) -> FloatArray:
    row, column = np.nonzero(np.ones(expected.shape))
    number = rng.poisson(expected).ravel()
    centres = np.repeat(np.stack([column, row], axis=1), number, axis=0)
    return np.asarray(centres + rng.uniform(-0.5, 0.5, centres.shape))


def _share_at(share: FloatImage, photons_pix: FloatArray) -> FloatArray:
    """Relative exposure where photons fall; 0 beyond the image."""
    column, row = np.rint(photons_pix).astype(np.int64).T
    inside = (column >= 0) & (column < share.shape[1]) & (row >= 0) & (row < share.shape[0])
    found = np.zeros(len(photons_pix))
    found[inside] = share[row[inside], column[inside]]
    return found


def observe(photons_pix: FloatArray, exposure_s: FloatImage, background: FloatImage | None = None) -> Observation:
    """The observation of these photons (all on the image), sorted as `Observation` promises."""
    height, width = exposure_s.shape
    column, row = np.rint(photons_pix).astype(np.int64).T
    order = np.lexsort((photons_pix[:, 0], column, row))
    counts = np.bincount(row * width + column, minlength=height * width).reshape(height, width)
    grid = PixelGrid((height, width), SCALE_ARCSEC, ((width - 1) / 2.0, (height - 1) / 2.0))
    photons = np.ascontiguousarray(photons_pix[order])
    return Observation(counts.astype(np.int32), photons, exposure_s, background, PSF, grid, BAND)


def photons_of(observation: Observation) -> FloatArray:
    """The photon list of a field of this module."""
    return np.zeros((0, 2)) if observation.photons_pix is None else observation.photons_pix


def moved(observation: Observation, dx_pix: int, dy_pix: int) -> Observation:
    """Everything shifted by whole pixels; what leaves at one side comes in at the other."""
    height, width = observation.counts.shape
    size = np.array([width, height])
    photons = (photons_of(observation) + np.array([dx_pix, dy_pix]) + 0.5) % size - 0.5
    background = observation.background
    rolled = None if background is None else np.roll(background, (dy_pix, dx_pix), axis=(0, 1))
    return observe(photons, np.roll(observation.exposure_s, (dy_pix, dx_pix), axis=(0, 1)), rolled)


def turned(observation: Observation, quarter_turns: int) -> Observation:
    """Everything turned about the middle of the image, as `numpy.rot90` does."""
    photons = turned_positions(photons_of(observation), quarter_turns, observation.counts.shape)
    background = observation.background
    granted = None if background is None else np.rot90(background, quarter_turns).copy()
    return observe(photons, np.rot90(observation.exposure_s, quarter_turns).copy(), granted)


def turned_positions(positions: FloatArray, quarter_turns: int, shape: tuple[int, ...]) -> FloatArray:
    """Positions (n, 2) on an image of this shape after `turned`."""
    height, width = shape
    for _ in range(quarter_turns):
        positions = np.stack([positions[:, 1], width - 1.0 - positions[:, 0]], axis=1)
        height, width = width, height
    return positions


def shuffled(observation: Observation, rng: np.random.Generator) -> Observation:
    """The same photons listed in another order."""
    return replace(observation, photons_pix=rng.permutation(photons_of(observation)))


def empty(shape: tuple[int, int] = SHAPE) -> Observation:
    """An image without a photon."""
    return observe(np.zeros((0, 2)), np.full(shape, EXPOSURE_S), np.zeros(shape))
