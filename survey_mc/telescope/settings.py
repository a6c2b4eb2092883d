"""What a campaign may say about its instrument: which effects are on, and other numbers than the instrument's own.

Idea     None means "the instrument's number"; every override is one named key.
Limits   the overrides do not know each other: a new pixel size rescales the instrument's own background, but not one
         that is given.
"""

from __future__ import annotations

from typing import Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from survey_mc.registry import UnknownName
from survey_mc.telescope.instruments import INSTRUMENTS, Instrument
from survey_mc.telescope.vignetting import VALID_ARCMIN, Coefficients

ModelT = TypeVar("ModelT", bound=BaseModel)


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class BandNumbers(_Frozen):
    """One number for each band, those not given as the instrument has them."""

    soft: float | None = Field(None, gt=0.0, description="value in the soft band")
    hard: float | None = Field(None, gt=0.0, description="value in the hard band")


class BandCoefficients(_Frozen):
    """Vignetting coefficients c1..c4 of each band, those not given as the instrument has them."""

    soft: Coefficients | None = Field(None, description="c1..c4 of the soft band, powers of θ/10′")
    hard: Coefficients | None = Field(None, description="c1..c4 of the hard band, powers of θ/10′")


class BelievedPsf(_Frozen):
    """The PSF the detection procedures are told, where it is not the true one."""

    fwhm_arcsec: float = Field(gt=0.0, le=300.0, description="believed full width at half maximum, arcsec")
    hew_arcsec: float = Field(gt=0.0, le=600.0, description="believed half-energy width, arcsec")

    @model_validator(mode="after")
    def _wings(self) -> Self:
        return _checked_widths(self, self.fwhm_arcsec, self.hew_arcsec)


class InstrumentSettings(_Frozen):
    """The [instrument] table of a campaign."""

    name: str = Field("xmm_epic", description="registered instrument")
    psf: bool = Field(True, description="scatter the photons by the point spread function")
    vignetting: bool = Field(True, description="lose off-axis photons, of sources and background")
    background: bool = Field(True, description="draw background photons")
    field_of_view: bool = Field(True, description="nothing is observed outside the circular field of view")
    grants_background: bool = Field(False, description="tell the procedures the true background map")
    background_cps_per_pix: BandNumbers | None = Field(None, description="background of an on-axis pixel, ct/s")
    flux_per_rate_cgs: BandNumbers | None = Field(None, description="erg/cm²/s of one ct/s on axis")
    vignetting_coefficients: BandCoefficients | None = Field(None, description="quartic of the vignetting")
    psf_fwhm_arcsec: float | None = Field(None, gt=0.0, le=300.0, description="full width at half maximum, arcsec")
    psf_hew_arcsec: float | None = Field(None, gt=0.0, le=600.0, description="half-energy width, arcsec")
    believed_psf: BelievedPsf | None = Field(None, description="PSF the procedures are told; default the true one")
    field_of_view_arcmin: float | None = Field(
        None, gt=0.0, le=120.0, description="radius of the field of view, arcmin"
    )
    n_pix: int | None = Field(None, ge=16, le=4096, description="pixels along a side of the image")
    scale_arcsec: float | None = Field(None, gt=0.0, le=60.0, description="side of a pixel, arcsec")
    pointing_deg: tuple[float, float] | None = Field(
        None, description="right ascension and declination of the axis, deg"
    )

    @field_validator("name")
    @classmethod
    def _registered(cls, name: str) -> str:
        try:
            return INSTRUMENTS[name].name
        except UnknownName as error:
            raise ValueError(str(error)) from error

    @field_validator("pointing_deg")
    @classmethod
    def _on_the_sphere(cls, pointing_deg: tuple[float, float] | None) -> tuple[float, float] | None:
        if pointing_deg is not None and not (0.0 <= pointing_deg[0] < 360.0 and -90.0 <= pointing_deg[1] <= 90.0):
            raise ValueError(f"must be [0..360, -90..90] (got {list(pointing_deg)})")
        return pointing_deg

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        instrument = INSTRUMENTS[self.name]
        if self.field_of_view and self.vignetting and (self.field_of_view_arcmin or 0.0) > VALID_ARCMIN:
            raise ValueError(
                f"field_of_view_arcmin must be at most {VALID_ARCMIN:g}, to where the vignetting is known, "
                f"or vignetting = false (got {self.field_of_view_arcmin:g})"
            )
        for key in ("background_cps_per_pix", "flux_per_rate_cgs", "vignetting_coefficients"):
            _check_bands(key, getattr(self, key), instrument)
        fwhm_arcsec = self.psf_fwhm_arcsec or instrument.psf_fwhm_arcsec
        return _checked_widths(self, fwhm_arcsec, self.psf_hew_arcsec or instrument.psf_hew_arcsec)


def _check_bands(key: str, given: BandNumbers | BandCoefficients | None, instrument: Instrument) -> None:
    missing = set(given.model_dump(exclude_none=True) if given else ()) - set(instrument.band_names)
    if missing:
        known = ", ".join(instrument.band_names)
        raise ValueError(f"{key}: {instrument.name} has no band {min(missing)!r}; known: {known}")


def _checked_widths(model: ModelT, fwhm_arcsec: float, hew_arcsec: float) -> ModelT:
    if not fwhm_arcsec * 1.001 <= hew_arcsec <= fwhm_arcsec * 100.0:
        raise ValueError(
            "the half-energy width must be 1.001 to 100 times the FWHM, a King profile "
            f"(got FWHM {fwhm_arcsec:g}″, HEW {hew_arcsec:g}″)"
        )
    return model
