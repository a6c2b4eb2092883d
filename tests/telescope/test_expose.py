"""Drawn fields against closed forms and against the plain numpy drawing."""

from __future__ import annotations

import numpy as np
import pytest
from plain_expose import BARE, NO_SKY, field_of, plain_photons, sky_of

from survey_mc.telescope import InstrumentSettings
from survey_mc.telescope.beta_model import beta_profile
from survey_mc.telescope.response import build_response
from survey_mc.types import Field, Sky, SkyImage

Z_1E4 = 3.89  # two-sided 1e-4 false alarm of a normal variate
ONLY_PSF = BARE.model_copy(update={"psf": True})
ONLY_BACKGROUND = BARE.model_copy(update={"background": True})
SMALL = {"n_pix": 48}


def assert_poisson(found: float, expected: float) -> None:
    """Odds 1e-4, two-sided."""
    assert abs(found - expected) < Z_1E4 * np.sqrt(expected) + 1e-9


def assert_fractions(found: np.ndarray, expected_fractions: np.ndarray) -> None:
    """χ² of counts in classes against their probabilities; odds below 1e-4 on either side (normal approximation)."""
    expected = found.sum() * expected_fractions / expected_fractions.sum()
    chi2 = ((found - expected) ** 2 / expected).sum()
    freedom = len(found) - 1
    assert abs(chi2 - freedom) < Z_1E4 * np.sqrt(2.0 * freedom) + 4.0


def radii_arcsec(field: Field, x_arcsec: float, y_arcsec: float) -> np.ndarray:
    """Distance of every photon from a sky position."""
    grid, photons_pix = field.observation.grid, field.observation.photons_pix
    dx_pix = photons_pix[:, 0] - grid.pix_from_arcsec(x_arcsec, 0)
    dy_pix = photons_pix[:, 1] - grid.pix_from_arcsec(y_arcsec, 1)
    return np.hypot(dx_pix, dy_pix) * grid.scale_arcsec


def test_photons_of_a_point_source_follow_the_encircled_energy() -> None:
    field = field_of(sky_of((1.3, -0.7, 20.0)), ONLY_PSF, 1e4)
    edges = np.array([0.0, 1.0, 2.0, 4.0, 6.0, 10.0, 15.0, 30.0, 60.0, 120.0, 240.0, 480.0, 900.0])
    found, _ = np.histogram(radii_arcsec(field, 1.3, -0.7), edges)
    assert found.sum() > 1.9e5
    assert_fractions(found, np.diff(ONLY_PSF_PSF.encircled_energy(edges)))


def test_photons_of_a_point_source_go_in_every_direction() -> None:
    field = field_of(sky_of((0.0, 0.0, 20.0)), ONLY_PSF, 1e4)
    photons_pix = field.observation.photons_pix - np.array(field.observation.grid.axis_pix)
    angle = np.arctan2(photons_pix[:, 1], photons_pix[:, 0])[np.hypot(*photons_pix.T) < 200.0]
    assert_fractions(np.histogram(angle, 36, (-np.pi, np.pi))[0], np.ones(36))


def test_photons_of_a_cluster_follow_the_beta_model() -> None:
    no_psf = sky_of((0.0, 0.0, 10.0), core_radius_arcsec=30.0, beta=0.75)
    field = field_of(no_psf, BARE, 1e4)
    edges = 30.0 * np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0])
    found, _ = np.histogram(radii_arcsec(field, 0.0, 0.0), edges)
    assert_fractions(found, np.diff(beta_profile(30.0, 0.75).encircled_energy(edges)))


def test_background_pixels_are_poisson_about_their_expectation() -> None:
    field = field_of(NO_SKY, InstrumentSettings(), 1e5)
    expected, counts = field.background_expected, field.observation.counts
    assert_poisson(counts.sum(), expected.sum())
    assert counts[expected == 0.0].sum() == 0
    seen = expected > 0.0
    chi2 = ((counts[seen] - expected[seen]) ** 2 / expected[seen]).sum()
    variance = (2.0 + 1.0 / expected[seen]).sum()
    assert abs(chi2 - seen.sum()) < Z_1E4 * np.sqrt(variance)


def test_background_follows_the_vignetting_in_rings() -> None:
    field = field_of(NO_SKY, InstrumentSettings(), 1e5)
    y_pix, x_pix = np.indices(field.observation.counts.shape)
    ring = field.observation.grid.offaxis_arcmin(x_pix, y_pix).astype(int)
    for arcmin in range(15):
        inside = ring == arcmin
        assert_poisson(field.observation.counts[inside].sum(), field.background_expected[inside].sum())


def test_background_photons_are_uniform_inside_their_pixels() -> None:
    field = field_of(NO_SKY, ONLY_BACKGROUND, 1e5)
    inside = (field.observation.photons_pix + 0.5) % 1.0
    for axis in (0, 1):
        assert_fractions(np.histogram(inside[:, axis], 40, (0.0, 1.0))[0], np.ones(40))
    quarters = np.histogram2d(*inside.T, bins=4, range=[[0, 1], [0, 1]])[0]
    assert_fractions(quarters.ravel(), np.ones(16))


def test_neighbouring_background_pixels_are_independent() -> None:
    counts = field_of(NO_SKY, ONLY_BACKGROUND, 1e5).observation.counts.astype(float)
    for shifted in (counts[:, 1:], counts[1:, :]):
        base = counts[: shifted.shape[0], : shifted.shape[1]]
        correlation = np.corrcoef(base.ravel(), shifted.ravel())[0, 1]
        assert abs(correlation) < Z_1E4 / np.sqrt(base.size)


def test_a_source_at_10_arcmin_is_vignetted_once() -> None:
    field = field_of(sky_of((600.0, 0.0, 30.0)), BARE.model_copy(update={"vignetting": True}), 1e4)
    row = field.truth.iloc[0]
    assert row["counts_onaxis"] == pytest.approx(3e5)
    assert row["counts_expected"] == pytest.approx(0.53 * 3e5, rel=1e-6)
    assert_poisson(row["counts_drawn"], 0.53 * 3e5)


def test_expected_counts_of_a_cluster_average_the_vignetting_over_its_profile() -> None:
    only_vignetting = InstrumentSettings(psf=False, background=False)
    sky = sky_of((300.0, 420.0, 20.0), (0.0, 0.0, 20.0), core_radius_arcsec=60.0, beta=0.75)
    truth = field_of(sky, only_vignetting, 1e4).truth
    assert np.all(truth["counts_expected"] < 0.98 * truth["counts_onaxis"])
    for expected, drawn in zip(truth["counts_expected"], truth["counts_drawn"], strict=True):
        # the quadrature of the expectation is good to 1e-3
        assert abs(drawn - expected) < Z_1E4 * np.sqrt(expected) + 1e-3 * expected


def test_a_source_outside_the_field_of_view_gives_nothing() -> None:
    field = field_of(sky_of((960.0, 0.0, 10.0), (0.0, 1070.0, 10.0)), InstrumentSettings(background=False), 1e4)
    assert field.truth["counts_drawn"].sum() == field.truth["counts_expected"].sum() == 0.0


def test_no_photon_lies_where_nothing_is_observed() -> None:
    field = field_of(sky_of((890.0, 0.0, 50.0)), InstrumentSettings(), 1e4)
    assert field.observation.counts[field.observation.exposure_s == 0.0].sum() == 0
    assert 0 < field.truth["counts_drawn"][0] < field.truth["counts_expected"][0]


def test_one_bright_pixel_of_an_image_is_a_point_source() -> None:
    pixels = np.zeros((21, 31))
    pixels[10, 25] = 20.0
    sky_image = SkyImage(pixels, 0.5)
    imaged = field_of(Sky(NO_SKY.source_rows, (sky_image,)), InstrumentSettings(background=False), 1e4)
    point = field_of(sky_of((5.0, 0.0, 20.0)), InstrumentSettings(background=False), 1e4, "other")
    assert imaged.truth["kind"].tolist() == ["image"]
    assert imaged.truth["counts_expected"][0] == pytest.approx(point.truth["counts_expected"][0], rel=1e-6)
    assert_poisson(imaged.truth["counts_drawn"][0] - point.truth["counts_drawn"][0] + 4e5, 4e5)
    # a pixel of 0.5″ widens the 6″ PSF by 0.3 % only
    edges = np.array([0.0, 3.0, 6.0, 10.0, 15.0, 30.0, 60.0, 200.0, 600.0])
    for field in (imaged, point):
        found, _ = np.histogram(radii_arcsec(field, 5.0, 0.0), edges)
        assert_fractions(found, np.diff(ONLY_PSF_PSF.encircled_energy(edges)))


def test_sky_image_is_neither_flipped_nor_turned() -> None:
    pixels = np.zeros((4, 6))
    pixels[3, 1] = 1.0
    field = field_of(Sky(NO_SKY.source_rows, (SkyImage(pixels, 40.0),)), BARE, 1e4)
    x_arcsec, y_arcsec = (field.observation.photons_pix - np.array(field.observation.grid.axis_pix)).T * 4.0
    assert x_arcsec.min() > -80.0 - 1e-6
    assert x_arcsec.max() < -40.0 + 1e-6
    assert y_arcsec.min() > 40.0 - 1e-6
    assert y_arcsec.max() < 80.0 + 1e-6


def test_images_follow_the_sources_in_the_truth() -> None:
    sky = Sky(sky_of((0.0, 0.0, 0.1)).source_rows, (SkyImage(np.ones((3, 3)), 4.0), SkyImage(np.ones((2, 2)), 4.0)))
    field = field_of(sky, InstrumentSettings(**SMALL), 10.0)
    assert field.truth["source_id"].tolist() == [0, 1, 2]
    assert field.truth["kind"].tolist() == ["point", "image", "image"]
    assert field.truth["counts_onaxis"].tolist() == pytest.approx([1.0, 90.0, 40.0])
    assert set(np.unique(field.origin)) <= {-1, 0, 1, 2}


def test_compiled_and_plain_drawing_agree() -> None:
    response = build_response(InstrumentSettings(), "soft", 1e4)
    points = sky_of((0.0, 0.0, 1.0), (500.0, 300.0, 2.0), (-880.0, 10.0, 3.0))
    cluster = sky_of((-400.0, -500.0, 3.0), core_radius_arcsec=90.0, beta=2.0 / 3.0)
    for sky in (points, cluster):
        fast = field_of(sky, InstrumentSettings(), 1e4)
        plain_pix, plain_origin = plain_photons(sky, response, np.random.Generator(np.random.PCG64(7)))
        for number in range(-1, len(sky.sources)):
            of_fast, of_plain = fast.origin == number, plain_origin == number
            centre = [255.5, 255.5] if number < 0 else fast.truth.loc[number, ["x_pix", "y_pix"]].to_list()
            shape = [
                np.histogram(
                    np.hypot(*(photons - np.array(centre, dtype=float)).T), [0, 1, 2, 4, 8, 16, 32, 64, 128, 400]
                )[0]
                for photons in (fast.observation.photons_pix[of_fast], plain_pix[of_plain])
            ]
            total = shape[0] + shape[1]
            used = total > 10
            chi2 = ((shape[0] - shape[1])[used] ** 2 / total[used]).sum()
            # odds 1e-4 for each of six comparisons
            assert chi2 < used.sum() + Z_1E4 * np.sqrt(2.0 * used.sum()) + 5.0


ONLY_PSF_PSF = build_response(ONLY_PSF, "soft", 1e4).psf
