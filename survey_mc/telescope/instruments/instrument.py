"""What an instrument is: numbers only.

Idea     one record a file; what is done with the numbers stands in `response` and `expose`.
"""

from __future__ import annotations

from dataclasses import dataclass

from survey_mc.telescope.vignetting import Coefficients


@dataclass(frozen=True, slots=True)
class InstrumentBand:
    """One energy band of an instrument.

    background_cps_per_pix: ct/s in an on-axis pixel. flux_per_rate_cgs: erg/cm²/s of one ct/s on axis.
    vignetting: c₁…c₄ of `vignetting.vignetting`.
    """

    name: str
    energy_min_kev: float
    energy_max_kev: float
    background_cps_per_pix: float
    flux_per_rate_cgs: float
    vignetting: Coefficients


@dataclass(frozen=True, slots=True)
class Instrument:
    """A telescope with its detector, all cameras summed. field_of_view_arcmin is a radius."""

    name: str
    label: str
    about: str
    reference: str
    n_pix: int
    scale_arcsec: float
    psf_fwhm_arcsec: float
    psf_hew_arcsec: float
    field_of_view_arcmin: float
    bands: tuple[InstrumentBand, ...]

    @property
    def band_names(self) -> tuple[str, ...]:
        return tuple(band.name for band in self.bands)
