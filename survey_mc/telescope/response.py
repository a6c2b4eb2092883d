"""All that stands between a sky and an image: one record per instrument setting, band and exposure.

Idea     made once and kept: the maps of exposure and background, the PSF of the photons, the PSF the observer believes.
         Vignetting is one number per pixel (at its centre), so that exposure map and drawn background agree exactly.
Limits   with the field of view switched off, vignetting keeps its value of 15′ beyond 15′.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.errors import BadInput
from survey_mc.telescope.instruments import INSTRUMENTS, Instrument, InstrumentBand
from survey_mc.telescope.psf import KingPsf
from survey_mc.telescope.settings import BandNumbers, InstrumentSettings
from survey_mc.telescope.vignetting import NO_VIGNETTING, Coefficients, check_coefficients, held_vignetting
from survey_mc.types import Band, BoolArray, FloatArray, FloatImage, PixelGrid, Psf
from survey_mc.units import ARCSEC_PER_ARCMIN, ARCSEC_PER_DEG, deg2_of_circle

if TYPE_CHECKING:
    from astropy.wcs import WCS

KEPT_RESPONSES = 8  # 4.3 MB each at 512 × 512


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """What one exposure in one band does to a sky.

    psf: the true one, None when switched off. exposure_map_s: (ny, nx), exposure × vignetting, 0 outside the field of
    view. background_expected: (ny, nx) counts; background_edges: (ny·nx + 1,) their accumulation in row-major order,
    from 0 to the total of the image. in_view: (ny, nx), True where something is observed. field_of_view_arcmin: its
    radius, infinite when switched off.
    """

    grid: PixelGrid
    band: Band
    exposure_s: float
    psf: KingPsf | None
    believed_psf: Psf
    vignetting: Coefficients
    field_of_view_arcmin: float
    exposure_map_s: FloatImage
    background_expected: FloatImage
    background_edges: FloatArray
    in_view: BoolArray
    grants_background: bool

    @property
    def half_width_arcsec(self) -> float:
        """Half of the side of the image."""
        return self.grid.shape[0] * self.grid.scale_arcsec / 2.0

    def observed_deg2(self, radius_arcmin: float) -> float:
        """Area of what is observed within an angle of the axis (deg²): the circle, cut by field of view and image."""
        radius_arcmin = min(radius_arcmin, self.field_of_view_arcmin)
        if radius_arcmin * ARCSEC_PER_ARCMIN <= self.half_width_arcsec:
            return deg2_of_circle(radius_arcmin)
        y_pix, x_pix = np.indices(self.grid.shape, dtype=np.float64)
        n_pix = np.count_nonzero(self.in_view & (self.grid.offaxis_arcmin(x_pix, y_pix) <= radius_arcmin))
        return float(n_pix * (self.grid.scale_arcsec / ARCSEC_PER_DEG) ** 2)

    def seen_share(self, offaxis_arcmin: FloatArray) -> FloatArray:
        """Chance that a photon from an off-axis angle is observed: vignetting, 0 outside the field of view."""
        in_view = offaxis_arcmin <= self.field_of_view_arcmin
        return np.where(in_view, held_vignetting(offaxis_arcmin, self.vignetting), 0.0)

    def is_on_image(self, x_arcsec: FloatArray, y_arcsec: FloatArray) -> BoolArray:
        """Which sky directions are those of the image."""
        return np.maximum(np.abs(x_arcsec), np.abs(y_arcsec)) < self.half_width_arcsec

    def transmission(self, x_arcsec: FloatArray, y_arcsec: FloatArray) -> FloatArray:
        """Chance that a photon from a sky direction is observed: vignetting, 0 outside field of view and image."""
        offaxis_arcmin = np.hypot(x_arcsec, y_arcsec) / ARCSEC_PER_ARCMIN
        return np.where(self.is_on_image(x_arcsec, y_arcsec), self.seen_share(offaxis_arcmin), 0.0)


@bounded_cache(KEPT_RESPONSES)
def build_response(settings: InstrumentSettings, band_name: str, exposure_s: float) -> Response:
    """The response of an instrument as a campaign sets it; the same object for the same arguments.

    Raises BadInput for a band the instrument does not have or vignetting coefficients that are no probability.
    """
    instrument = INSTRUMENTS[settings.name]
    own = _band_of(instrument, band_name)
    grid = _grid(settings, instrument)
    coefficients = _vignetting(settings, own)
    fov_arcmin = settings.field_of_view_arcmin or instrument.field_of_view_arcmin
    if not settings.field_of_view:
        fov_arcmin = float("inf")

    y_pix, x_pix = np.indices(grid.shape, dtype=np.float64)
    offaxis_arcmin = grid.offaxis_arcmin(x_pix, y_pix)
    in_view = offaxis_arcmin <= fov_arcmin
    seen = np.where(in_view, held_vignetting(offaxis_arcmin, coefficients), 0.0)
    background_cps = _background_cps_per_pix(settings, instrument, own) if settings.background else 0.0
    background_expected = background_cps * exposure_s * seen
    psf = KingPsf.from_fwhm_hew(
        settings.psf_fwhm_arcsec or instrument.psf_fwhm_arcsec, settings.psf_hew_arcsec or instrument.psf_hew_arcsec
    )
    believed = settings.believed_psf
    response = Response(
        grid=grid,
        band=Band(
            own.name,
            own.energy_min_kev,
            own.energy_max_kev,
            _given(settings.flux_per_rate_cgs, band_name) or own.flux_per_rate_cgs,
        ),
        exposure_s=exposure_s,
        psf=psf if settings.psf else None,
        believed_psf=KingPsf.from_fwhm_hew(believed.fwhm_arcsec, believed.hew_arcsec) if believed else psf,
        vignetting=coefficients,
        field_of_view_arcmin=fov_arcmin,
        exposure_map_s=exposure_s * seen,
        background_expected=background_expected,
        background_edges=np.concatenate(([0.0], np.cumsum(background_expected))),
        in_view=in_view,
        grants_background=settings.grants_background,
    )
    frozen = (response.exposure_map_s, response.background_expected, response.background_edges, response.in_view)
    for values in frozen:
        values.setflags(write=False)
    return response


def _band_of(instrument: Instrument, band_name: str) -> InstrumentBand:
    for band in instrument.bands:
        if band.name == band_name:
            return band
    known = ", ".join(instrument.band_names)
    raise BadInput("grid.band", f"{instrument.name} has no band {band_name!r}; known: {known}")


def _grid(settings: InstrumentSettings, instrument: Instrument) -> PixelGrid:
    n_pix = settings.n_pix or instrument.n_pix
    centred = PixelGrid.centred(n_pix, settings.scale_arcsec or instrument.scale_arcsec)
    if settings.pointing_deg is None:
        return centred
    return PixelGrid(
        centred.shape, centred.scale_arcsec, centred.axis_pix, _tangent_wcs(centred, settings.pointing_deg)
    )


def _tangent_wcs(grid: PixelGrid, pointing_deg: tuple[float, float]) -> WCS:
    from astropy.wcs import WCS

    wcs = WCS(naxis=2)
    wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    wcs.wcs.crval = list(pointing_deg)
    wcs.wcs.crpix = [grid.axis_pix[0] + 1.0, grid.axis_pix[1] + 1.0]  # FITS counts pixels from 1
    degrees = grid.scale_arcsec / 3600.0
    wcs.wcs.cdelt = [-degrees, degrees]
    wcs.wcs.cunit = ["deg", "deg"]
    wcs.wcs.radesys = "ICRS"
    return wcs


def _vignetting(settings: InstrumentSettings, own: InstrumentBand) -> Coefficients:
    if not settings.vignetting:
        return NO_VIGNETTING
    coefficients: Coefficients = getattr(settings.vignetting_coefficients, own.name, None) or own.vignetting
    check_coefficients(f"instrument.vignetting_coefficients.{own.name}", coefficients)
    return coefficients


def _background_cps_per_pix(settings: InstrumentSettings, instrument: Instrument, own: InstrumentBand) -> float:
    given = _given(settings.background_cps_per_pix, own.name)
    if given is not None:
        return given
    # the instrument's number is for its own pixel size
    return (
        own.background_cps_per_pix * ((settings.scale_arcsec or instrument.scale_arcsec) / instrument.scale_arcsec) ** 2
    )


def _given(overrides: BandNumbers | None, band_name: str) -> float | None:
    return getattr(overrides, band_name, None)
