"""The records that flow through the pipeline.

Idea     frozen records, read-only arrays. A detector receives an `Observation` and nothing else, so truth cannot reach
         it.
Limits   images are indexed [y, x]; the centre of the first pixel is at (0, 0) (FITS counts it as (1, 1)).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame

if TYPE_CHECKING:
    from astropy.wcs import WCS
    from pandas import DataFrame

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
FloatImage = NDArray[np.float64]
IntImage = NDArray[np.int32]
BandName = Literal["soft", "hard"]


def frozen_array(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """The same array, made read-only: whoever writes into an input fails at once."""
    values.setflags(write=False)
    return values


@dataclass(frozen=True, slots=True)
class Band:
    """An energy band as one instrument sees it.

    flux_per_rate_cgs: erg/cm²/s of one ct/s on axis (see `units`); None where it is not known (a user's image).
    """

    name: str
    energy_min_kev: float
    energy_max_kev: float
    flux_per_rate_cgs: float | None = None


@dataclass(frozen=True, slots=True)
class PixelGrid:
    """Square pixels on the tangent plane: x to the right, y up, (0, 0) the centre of the first pixel.

    axis_pix: (x, y) of the optical axis in pixels (off-axis angles are counted from it).
    wcs: celestial coordinates of the image, None for a simulated field that has no pointing.
    """

    shape: tuple[int, int]
    scale_arcsec: float
    axis_pix: tuple[float, float]
    wcs: WCS | None = field(default=None, compare=False)

    @classmethod
    def centred(cls, n_pix: int, scale_arcsec: float) -> PixelGrid:
        """Square grid whose optical axis is the middle of the image."""
        middle = (n_pix - 1) / 2.0
        return cls((n_pix, n_pix), scale_arcsec, (middle, middle))

    def pix_from_arcsec(self, offset_arcsec: FloatArray, axis: int) -> FloatArray:
        """Pixel coordinate of an offset from the optical axis; axis 0 is x, 1 is y."""
        return np.asarray(offset_arcsec / self.scale_arcsec + self.axis_pix[axis], dtype=np.float64)

    def offaxis_arcmin(self, x_pix: FloatArray, y_pix: FloatArray) -> FloatArray:
        """Angle (arcmin) between pixel positions and the optical axis."""
        radius_pix = np.hypot(np.asarray(x_pix) - self.axis_pix[0], np.asarray(y_pix) - self.axis_pix[1])
        return np.asarray(radius_pix * self.scale_arcsec / 60.0, dtype=np.float64)


class Psf(Protocol):
    """A circular point spread function of unit integral over the plane."""

    def encircled_energy(self, radius_arcsec: FloatArray) -> FloatArray:
        """Fraction of the photons inside a radius."""

    def surface_brightness(self, radius_arcsec: FloatArray) -> FloatArray:
        """Photon density per arcsec²."""

    @property
    def fwhm_arcsec(self) -> float: ...

    @property
    def hew_arcsec(self) -> float:
        """Half-energy width: diameter of the circle with half of the photons."""


@dataclass(frozen=True, slots=True)
class SkyImage:
    """A sky given as an image: on-axis rate (ct/s) of each of its square pixels, centred on the optical axis."""

    rate_cps: FloatImage
    scale_arcsec: float


@dataclass(frozen=True, slots=True)
class Sky:
    """What is up there, before any instrument: a table of sources and, optionally, images.

    source_rows: the columns of `SKY_COLUMNS`, one row a source; its row number is its source_id in the field.
    """

    source_rows: ArrayFrame
    images: tuple[SkyImage, ...] = ()

    @property
    def sources(self) -> DataFrame:
        """The sources as a new frame, to look at."""
        return self.source_rows.frame()


SKY_COLUMNS = (
    "kind",
    "x_arcsec",
    "y_arcsec",
    "flux_cgs",
    "rate_cps",
    "core_radius_arcsec",
    "beta",
    "redshift",
    "group_id",
    "group_sep_arcsec",
)


@dataclass(frozen=True, slots=True)
class Observation:
    """All that an observer has; never the truth.

    counts: (ny, nx) photons per pixel. photons_pix: (n, 2) unbinned x, y of the photons in row-major pixel order
    (x ascending within a pixel), None for a binned file. exposure_s: (ny, nx) exposure × vignetting, 0 = not observed.
    background: (ny, nx) expected background counts per pixel, only where the campaign grants it.
    psf: the PSF the observer believes, which may differ from the drawn one.
    """

    counts: IntImage
    photons_pix: FloatArray | None
    exposure_s: FloatImage
    background: FloatImage | None
    psf: Psf
    grid: PixelGrid
    band: Band

    def __post_init__(self) -> None:
        for values in (self.counts, self.photons_pix, self.exposure_s, self.background):
            if values is not None:
                values.setflags(write=False)


@dataclass(frozen=True, slots=True)
class Field:
    """One drawn realisation: what is up there and what was observed of it.

    truth_rows: `columns.TRUTH` without `realisation`, sorted by source_id = 0 … n−1. origin: (n_photons,) source_id of
    each photon, −1 = background, same order as `observation.photons_pix`. row_start: (ny + 1,) index of the first
    photon of each row of pixels, so those of row y are origin[row_start[y]:row_start[y + 1]], x ascending.
    background_expected: (ny, nx) true expected background counts per pixel, vignetted.
    """

    key: str
    truth_rows: ArrayFrame
    origin: IntArray
    row_start: NDArray[np.int64]
    background_expected: FloatImage
    observation: Observation

    @property
    def truth(self) -> DataFrame:
        """The truth as a new frame, to look at."""
        return self.truth_rows.frame()


@dataclass(frozen=True, slots=True)
class Skip:
    """A detector's statement that it cannot work on this observation, and why. Not a failure, not an empty result."""

    reason: str
