"""Test fields drawn without the telescope: flat Poisson sky plus sources scattered by the King profile formula."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from survey_mc.types import Band, FloatArray, Observation, PixelGrid

SCALE_ARCSEC = 4.0
EXPOSURE_S = 1e4
BACKGROUND_10KS = 0.178  # counts per pixel, soft band
BACKGROUND_100KS = 1.78
FLUX_PER_RATE_CGS = 6.70e-13


@dataclass(frozen=True)
class TestPsf:
    """King profile of FWHM 6″ and HEW 15″."""

    __test__ = False
    slope: float = 1.4377
    core_radius_arcsec: float = 3.812

    def encircled_energy(self, radius_arcsec: FloatArray) -> FloatArray:
        x2 = np.square(np.asarray(radius_arcsec) / self.core_radius_arcsec)
        return np.asarray(1.0 - (1.0 + x2) ** (1.0 - self.slope))

    def surface_brightness(self, radius_arcsec: FloatArray) -> FloatArray:
        x2 = np.square(np.asarray(radius_arcsec) / self.core_radius_arcsec)
        return np.asarray((self.slope - 1.0) / (np.pi * self.core_radius_arcsec**2) * (1.0 + x2) ** -self.slope)

    @property
    def fwhm_arcsec(self) -> float:
        return 6.0

    @property
    def hew_arcsec(self) -> float:
        return 15.0


def profile_offsets_pix(rng: np.random.Generator, n: int, core_radius_arcsec: float, slope: float) -> FloatArray:
    """(n, 2) offsets of photons of a King profile; a β-model has slope 3β − ½."""
    radius = core_radius_arcsec * np.sqrt((1.0 - rng.random(n)) ** (1.0 / (1.0 - slope)) - 1.0) / SCALE_ARCSEC
    angle = 2.0 * np.pi * rng.random(n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def photon_image(
    rng: np.random.Generator,
    background: float,
    sources: Sequence[tuple[float, float, float]] = (),
    n_pix: int = 512,
    cluster_core_arcsec: float | None = None,
) -> np.ndarray:
    """Counts image; sources: (x_pix, y_pix, expected counts), points or β = 0.75 clusters seen through the PSF."""
    image = rng.poisson(background, (n_pix, n_pix)).astype(np.int32)
    for x, y, counts in sources:
        n = rng.poisson(counts)
        place = np.array([x, y]) + profile_offsets_pix(rng, n, TestPsf.core_radius_arcsec, TestPsf.slope)
        if cluster_core_arcsec is not None:
            place += profile_offsets_pix(rng, n, cluster_core_arcsec, 3.0 * 0.75 - 0.5)
        column, row = np.rint(place).astype(int).T
        inside = (column >= 0) & (column < n_pix) & (row >= 0) & (row < n_pix)
        np.add.at(image, (row[inside], column[inside]), 1)
    return image


def observe(counts: np.ndarray, exposure_s: np.ndarray | None = None, known_flux: bool = True) -> Observation:
    """Observation of a counts image, flat exposure unless given."""
    exposure = np.full(counts.shape, EXPOSURE_S) if exposure_s is None else exposure_s
    height, width = counts.shape
    grid = PixelGrid(counts.shape, SCALE_ARCSEC, ((width - 1) / 2.0, (height - 1) / 2.0))
    band = Band("soft", 0.5, 2.0, FLUX_PER_RATE_CGS if known_flux else None)
    return Observation(counts.astype(np.int32), None, exposure, None, TestPsf(), grid, band)


def grid_positions(n_side: int, n_pix: int, rng: np.random.Generator) -> FloatArray:
    """(n_side², 2) positions on a regular grid with random sub-pixel phases."""
    step = n_pix / n_side
    at = (np.arange(n_side) + 0.5) * step
    x, y = np.meshgrid(at, at)
    return np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-0.5, 0.5, (n_side**2, 2))
