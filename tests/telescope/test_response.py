"""What a campaign may set about an instrument, and the maps that follow."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from survey_mc.errors import BadInput
from survey_mc.telescope import INSTRUMENTS, InstrumentSettings
from survey_mc.telescope.response import build_response
from survey_mc.units import rate_from_flux


def test_epic_has_the_papers_numbers() -> None:
    epic = INSTRUMENTS["xmm_epic"]
    assert (epic.n_pix, epic.scale_arcsec, epic.psf_fwhm_arcsec, epic.psf_hew_arcsec) == (512, 4.0, 6.0, 15.0)
    assert [band.background_cps_per_pix for band in epic.bands] == [1.78e-5, 2.4e-5]


@pytest.mark.parametrize(
    ("band", "exposure_s", "photons"),
    [("soft", 1e4, 4.67e4), ("soft", 1e5, 4.67e5), ("hard", 1e4, 6.3e4), ("hard", 1e5, 6.3e5)],
)
def test_unvignetted_background_of_the_whole_image(band: str, exposure_s: float, photons: float) -> None:
    flat = InstrumentSettings(vignetting=False, field_of_view=False)
    assert build_response(flat, band, exposure_s).background_expected.sum() == pytest.approx(photons, rel=2e-3)


def test_90_photons_of_the_papers_own_check() -> None:
    band = build_response(InstrumentSettings(), "soft", 1e5).band
    assert rate_from_flux(6e-16, band.flux_per_rate_cgs) * 1e5 == pytest.approx(89.6, abs=0.05)


def test_exposure_map_is_exposure_times_vignetting_inside_the_field_of_view() -> None:
    response = build_response(InstrumentSettings(), "soft", 1e4)
    axis = response.grid.axis_pix[0]
    at = {arcmin: response.exposure_map_s[255, round(axis + arcmin * 15.0)] for arcmin in (0, 10, 15.5)}
    assert at[0] == pytest.approx(1e4, rel=1e-3)
    assert at[10] == pytest.approx(0.53e4, rel=5e-3)
    assert at[15.5] == 0.0
    assert np.array_equal(response.exposure_map_s > 0.0, response.in_view)


def test_background_is_vignetted_exactly_like_the_exposure() -> None:
    response = build_response(InstrumentSettings(), "hard", 1e4)
    assert np.allclose(response.background_expected, 2.4e-5 * response.exposure_map_s, rtol=1e-12)


def test_effects_can_be_switched_off_one_by_one() -> None:
    flat = build_response(InstrumentSettings(vignetting=False), "soft", 1e4)
    assert set(np.unique(flat.exposure_map_s)) == {0.0, 1e4}
    square = build_response(InstrumentSettings(field_of_view=False), "soft", 1e4)
    assert square.in_view.all()
    assert square.exposure_map_s.min() == pytest.approx(0.335e4, abs=6.0)
    assert build_response(InstrumentSettings(background=False), "soft", 1e4).background_expected.max() == 0.0
    assert build_response(InstrumentSettings(psf=False), "soft", 1e4).psf is None


def test_response_is_made_once_and_read_only() -> None:
    response = build_response(InstrumentSettings(), "soft", 1e4)
    assert build_response(InstrumentSettings(name="xmm_epic"), "soft", 1e4) is response
    with pytest.raises(ValueError, match="read-only"):
        response.exposure_map_s[0, 0] = 1.0


def test_numbers_of_the_instrument_can_be_replaced() -> None:
    settings = InstrumentSettings(
        background_cps_per_pix={"soft": 1e-4},
        flux_per_rate_cgs={"soft": 1e-12},
        vignetting_coefficients={"soft": (-0.1, 0.0, 0.0, 0.0)},
        psf_fwhm_arcsec=4.0,
        psf_hew_arcsec=14.0,
        field_of_view_arcmin=8.0,
        n_pix=256,
    )
    soft = build_response(settings, "soft", 1e4)
    assert soft.grid.shape == (256, 256)
    assert soft.background_expected.max() == pytest.approx(1.0, rel=2e-3)
    assert soft.band.flux_per_rate_cgs == 1e-12
    assert soft.transmission(np.array([420.0]), np.array([0.0]))[0] == pytest.approx(0.93)
    assert soft.transmission(np.array([482.0]), np.array([0.0]))[0] == 0.0
    assert soft.psf is not None
    assert soft.psf.fwhm_arcsec == pytest.approx(4.0)
    hard = build_response(settings, "hard", 1e4)
    assert hard.band.flux_per_rate_cgs == 3.66e-12


def test_smaller_pixels_hold_less_of_the_instruments_background() -> None:
    flat = {"vignetting": False, "field_of_view": False}
    own = build_response(InstrumentSettings(**flat), "soft", 1e4)
    fine = build_response(InstrumentSettings(**flat, scale_arcsec=2.0, n_pix=1024), "soft", 1e4)
    assert fine.background_edges[-1] == pytest.approx(own.background_edges[-1])


def test_believed_psf_is_the_true_one_unless_told() -> None:
    true = build_response(InstrumentSettings(), "soft", 1e4)
    assert true.believed_psf == true.psf
    told = build_response(InstrumentSettings(believed_psf={"fwhm_arcsec": 9.0, "hew_arcsec": 20.0}), "soft", 1e4)
    assert told.believed_psf.hew_arcsec == pytest.approx(20.0)
    assert told.psf == true.psf


def test_pointing_puts_the_axis_at_the_given_place() -> None:
    response = build_response(InstrumentSettings(pointing_deg=(163.2, 57.5)), "soft", 1e4)
    assert response.grid.wcs is not None
    sky = response.grid.wcs.pixel_to_world(*response.grid.axis_pix)
    assert (sky.ra.deg, sky.dec.deg) == pytest.approx((163.2, 57.5), abs=1e-9)
    one_right = response.grid.wcs.pixel_to_world(response.grid.axis_pix[0] + 1.0, response.grid.axis_pix[1])
    assert one_right.ra.deg < 163.2
    assert one_right.separation(sky).arcsec == pytest.approx(4.0, rel=1e-6)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (
            {"name": "xmm_epik"},
            "unknown instrument 'xmm_epik'; known: chandra_acis, rosat_hri, xmm_epic; did you mean 'xmm_epic'",
        ),
        ({"field_of_view_arcmin": 16.0}, "at most 15, to where the vignetting is known"),
        ({"psf_hew_arcsec": 5.0}, "half-energy width must be 1.001 to 100 times the FWHM"),
        ({"believed_psf": {"fwhm_arcsec": 9.0, "hew_arcsec": 8.0}}, "half-energy width must be"),
        ({"pointing_deg": (400.0, 0.0)}, r"must be \[0..360, -90..90\]"),
        ({"background_cps_per_pix": {"medium": 1.0}}, "Extra inputs are not permitted"),
    ],
)
def test_wrong_settings_are_refused_with_a_sentence(values: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        InstrumentSettings(**values)


def test_unknown_band_and_impossible_vignetting_are_refused() -> None:
    with pytest.raises(BadInput, match="xmm_epic has no band 'medium'; known: soft, hard"):
        build_response(InstrumentSettings(), "medium", 1e4)
    steep = InstrumentSettings(vignetting_coefficients={"soft": (-1.0, 0.0, 0.0, 0.0)})
    with pytest.raises(BadInput, match=r"instrument.vignetting_coefficients.soft: .* must stay within 0..1"):
        build_response(steep, "soft", 1e4)


def test_every_setting_is_described() -> None:
    assert all(info.description for info in InstrumentSettings.model_fields.values())


@pytest.mark.parametrize(
    ("region_arcmin", "field_of_view", "expected_deg2"),
    [
        (10.0, True, np.pi * (10 / 60) ** 2),  # inside everything
        (16.0, True, np.pi * (15 / 60) ** 2),  # cut by the field of view
        (30.0, False, (512 * 4 / 3600) ** 2),  # the whole square
        (24.0, False, (512 * 4 / 3600) ** 2),  # all but the utmost corners, at 24.1′
    ],
)
def test_area_of_a_region_is_what_is_observed_of_it(
    region_arcmin: float, field_of_view: bool, expected_deg2: float
) -> None:
    response = build_response(InstrumentSettings(field_of_view=field_of_view, vignetting=False), "soft", 1e4)
    assert response.observed_deg2(region_arcmin) == pytest.approx(expected_deg2, rel=1e-3)
