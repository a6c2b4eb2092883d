"""The King profile, the vignetting quartic and the β-model against printed numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey_mc.errors import BadInput
from survey_mc.telescope.beta_model import beta_profile, profile_directions
from survey_mc.telescope.instruments import INSTRUMENTS
from survey_mc.telescope.psf import KingPsf, pixel_image
from survey_mc.telescope.vignetting import held_vignetting, vignetting

PAPER = KingPsf.from_fwhm_hew(6.0, 15.0)
SOFT, HARD = (band.vignetting for band in INSTRUMENTS["xmm_epic"].bands)


def test_paper_psf_is_fixed_by_its_two_widths() -> None:
    assert pytest.approx(1.4377, abs=5e-5) == PAPER.slope
    assert pytest.approx(3.812, abs=5e-4) == PAPER.core_radius_arcsec
    assert pytest.approx(6.0, rel=1e-12) == PAPER.fwhm_arcsec
    assert pytest.approx(15.0, rel=1e-12) == PAPER.hew_arcsec


def test_encircled_energy_of_the_paper_psf() -> None:
    assert PAPER.encircled_energy(np.array([6.0, 15.0, 30.0, 60.0])) == pytest.approx(
        [0.421, 0.707, 0.837, 0.911], abs=6e-4
    )
    assert 1.0 - PAPER.encircled_energy(np.array([120.0, 402.0])) == pytest.approx([0.049, 0.017], abs=6e-4)


def test_half_maximum_and_half_energy_are_where_the_widths_say() -> None:
    at_half = PAPER.surface_brightness(np.array([0.0, 3.0]))
    assert at_half[1] / at_half[0] == pytest.approx(0.5, rel=1e-9)
    assert PAPER.encircled_energy(np.array([7.5]))[0] == pytest.approx(0.5, rel=1e-9)


def test_surface_brightness_is_the_slope_of_the_encircled_energy() -> None:
    radius = np.linspace(0.0, 100.0, 200_001)
    ring = 2.0 * np.pi * radius * PAPER.surface_brightness(radius)
    assert np.trapezoid(ring, radius) == pytest.approx(PAPER.encircled_energy(np.array([100.0]))[0], rel=1e-6)


@given(fwhm=st.floats(0.5, 60.0), ratio=st.floats(1.01, 50.0), fraction=st.floats(1e-6, 0.999))
def test_any_widths_are_met_and_radii_inverted(fwhm: float, ratio: float, fraction: float) -> None:
    psf = KingPsf.from_fwhm_hew(fwhm, ratio * fwhm)
    assert psf.fwhm_arcsec == pytest.approx(fwhm, rel=1e-9)
    assert psf.hew_arcsec == pytest.approx(ratio * fwhm, rel=1e-9)
    radius = psf.radius_of_fraction(np.array([fraction]))
    assert psf.encircled_energy(radius)[0] == pytest.approx(fraction, rel=1e-9)


def test_equal_widths_are_nearly_a_gaussian() -> None:
    psf = KingPsf.from_fwhm_hew(10.0, 10.0 * 1.001)
    sigma = 10.0 / (2.0 * math.sqrt(2.0 * math.log(2.0)))
    radius = np.array([2.0, 5.0, 10.0])
    assert psf.encircled_energy(radius) == pytest.approx(1.0 - np.exp(-0.5 * (radius / sigma) ** 2), abs=3e-3)


def test_half_energy_width_below_fwhm_is_refused() -> None:
    with pytest.raises(BadInput, match="HEW must be larger than FWHM"):
        KingPsf.from_fwhm_hew(6.0, 5.0)


def test_pixel_image_holds_the_fractions_of_4_arcsec_pixels() -> None:
    assert pixel_image(PAPER, 4.0, 10)[10, 10] == pytest.approx(0.122, abs=6e-4)
    assert pixel_image(PAPER, 4.0, 10, 0.5, 0.5)[10, 10] == pytest.approx(0.079, abs=6e-4)
    assert 1.0 / (pixel_image(PAPER, 4.0, 60) ** 2).sum() == pytest.approx(30.6, abs=0.1)


def test_pixel_image_moves_with_its_source() -> None:
    assert np.allclose(pixel_image(PAPER, 4.0, 10, 1.0, -2.0)[:-2, 1:], pixel_image(PAPER, 4.0, 10)[2:, :-1], atol=1e-9)
    right = pixel_image(PAPER, 4.0, 5, dx_pix=0.3)
    assert right[5, 6] > right[5, 4]
    assert right[6, 5] == pytest.approx(right[4, 5])


def test_boxes_averaged_over_the_sub_pixel_position() -> None:
    shifts = (np.arange(8) + 0.5) / 8.0 - 0.5
    stamps = np.mean([pixel_image(PAPER, 4.0, 4, dx, dy) for dx in shifts for dy in shifts], axis=0)
    boxes = [stamps[4 - h : 5 + h, 4 - h : 5 + h].sum() for h in (1, 2, 4)]
    # 4e6 photons thrown at random places gave 0.4480, 0.6230, 0.7686, each to 2.5e-4
    assert boxes == pytest.approx([0.4480, 0.6230, 0.7686], abs=1e-3)


def test_vignetting_passes_through_the_papers_points() -> None:
    angles = np.array([0.0, 5.0, 6.0, 7.5, 10.0, 12.0, 15.0])
    assert vignetting(angles, SOFT) == pytest.approx([1.0, 0.818, 0.759, 0.669, 0.53, 0.438, 0.335], abs=6e-4)
    assert vignetting(angles, HARD) == pytest.approx([1.0, 0.787, 0.721, 0.623, 0.48, 0.391, 0.289], abs=6e-4)


def test_vignetting_falls_outwards_and_has_the_expected_mean_inside_10_arcmin() -> None:
    angles = np.linspace(0.0, 15.0, 1501)
    for coefficients, theta0_arcmin in ((SOFT, 10.62), (HARD, 9.61)):
        values = vignetting(angles, coefficients)
        inner = angles <= 10.0
        assert np.all(np.diff(values) < 0.0)
        # closed form for 1 / (1 + (θ/θ₀)²), which the quartic follows to 0.003
        square = (theta0_arcmin / 10.0) ** 2
        mean = square * math.log1p(1.0 / square)
        assert np.trapezoid((values * angles)[inner], angles[inner]) / 50.0 == pytest.approx(mean, abs=2e-3)


def test_vignetting_beyond_15_arcmin_is_an_error_or_held() -> None:
    with pytest.raises(BadInput, match="known to 15′ off axis"):
        vignetting(np.array([15.5]), SOFT)
    assert held_vignetting(np.array([15.5, 30.0]), SOFT) == pytest.approx(vignetting(np.array([15.0, 15.0]), SOFT))


def test_beta_model_encircles_the_printed_fractions() -> None:
    profile = beta_profile(1.0, 0.75)
    x = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0])
    assert profile.encircled_energy(x) == pytest.approx([0.154, 0.405, 0.587, 0.701, 0.822, 0.913, 0.969], abs=6e-4)
    assert profile.fwhm_arcsec == pytest.approx(1.394, abs=2e-3)
    assert profile.hew_arcsec / 2.0 == pytest.approx(1.233, abs=1e-3)
    assert profile.radius_of_fraction(np.array([0.9]))[0] == pytest.approx(4.53, abs=0.01)


def test_profile_directions_stand_for_equal_parts_of_a_cluster() -> None:
    dx_arcsec, dy_arcsec = profile_directions(30.0, 0.75)
    radius = np.hypot(dx_arcsec, dy_arcsec)
    assert np.mean(radius <= 30.0) == pytest.approx(0.405, abs=0.01)
    assert abs(dx_arcsec.mean()) < 1e-9
