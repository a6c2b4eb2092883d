"""The background map: unbiased on blank fields, follows the exposure, survives holes, masks and halos."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from detect_fields import TestPsf, observe, photon_image

from survey_mc.detect._eml.cheese_spline import CheeseSplineParams, background_map, cut_radius_pix
from survey_mc.detect._eml.poisson_spline import fit
from survey_mc.detect._eml.sliding_cell import SlidingCellParams, sliding_cell

Z_1E4 = 3.9  # two-sided 1e-4
METHODS = ["spline", "model", "smooth"]
QUARTIC = (1.0, 0.0, -1.0700256, 0.7674334, -0.1674078)  # of off-axis angle / 10′, held beyond 15′


def vignetted(n_pix=512):
    y, x = np.indices((n_pix, n_pix))
    angle = np.hypot(x - (n_pix - 1) / 2, y - (n_pix - 1) / 2) * 4.0 / 600.0
    share = sum(c * np.minimum(angle, 1.5) ** k for k, c in enumerate(QUARTIC))
    return np.where(angle < 1.5, share * 1e4, 0.0)


def mapped(counts, exposure=None, **params):
    observation = observe(counts, exposure)
    cells = sliding_cell(observation, None, SlidingCellParams())
    return background_map(observation, cells, CheeseSplineParams(**params))


@pytest.mark.parametrize("counts", [20.0, 1e3, 1e5])
def test_circles_reach_to_where_the_psf_falls_below_the_cut(counts):
    psf = TestPsf()
    peak = counts * (psf.slope - 1) / (math.pi * psf.core_radius_arcsec**2)
    expected_arcsec = psf.core_radius_arcsec * math.sqrt((peak / 0.01) ** (1 / psf.slope) - 1)
    assert cut_radius_pix(psf, 4.0, np.array([counts]), 0.01)[0] * 4.0 == pytest.approx(expected_arcsec, rel=1e-3)


def test_sources_too_faint_for_the_cut_have_no_circle():
    assert np.all(cut_radius_pix(TestPsf(), 4.0, np.array([1e-3, 0.0, -5.0]), 0.01) == 0.0)


@pytest.mark.parametrize("background", [0.178, 1.78])
@pytest.mark.parametrize("method", METHODS)
def test_maps_of_blank_vignetted_fields_are_within_one_percent(method, background):
    exposure = vignetted()
    expected = background * exposure / 1e4
    ratios = []
    for seed in range(3):
        counts = np.random.default_rng(seed).poisson(expected)
        ratios.append(mapped(counts, exposure, background=method).sum() / expected.sum())
    # 1e-4 two-sided of the photon noise besides
    assert abs(np.mean(ratios) - 1.0) < 0.01 + Z_1E4 / math.sqrt(3 * expected.sum())


def test_without_a_second_look_the_map_lacks_the_fluctuations_cut_out():
    counts = np.random.default_rng(1).poisson(0.178, (512, 512))
    assert mapped(counts, like_min_again=0.0).mean() / 0.178 == pytest.approx(0.945, abs=0.02)


@pytest.mark.parametrize("method", METHODS)
def test_the_map_follows_exposure_and_gaps(method):
    exposure = vignetted()
    exposure[:, 200:206] = 0.0
    expected = 1.78 * exposure / 1e4
    background = mapped(np.random.default_rng(2).poisson(expected), exposure, background=method)
    observed = exposure > 0
    assert np.all(background[~observed] == 0.0)
    assert np.std(background[observed] / expected[observed]) < (0.06 if method == "smooth" else 0.02)


def test_the_model_tells_particles_from_sky():
    exposure = vignetted()
    expected = np.where(exposure > 0, 0.15 * exposure / 1e4 + 0.08, 0.0)
    background = mapped(np.random.default_rng(3).poisson(expected), exposure, background="model")
    observed = exposure > 0
    assert np.abs(background[observed] / expected[observed] - 1.0).max() < 0.06


def test_a_few_photons_are_not_lost():
    expected = 46_000 * 1e-3
    rates = [mapped(np.random.default_rng(s).poisson(1e-3, (215, 214))).sum() for s in range(12)]
    assert abs(np.mean(rates) - expected) < Z_1E4 * math.sqrt(expected / 12)


@pytest.mark.parametrize("level", [2.0, 180.0])
def test_fitted_counts_add_up_to_the_observed_ones(level):
    rng = np.random.default_rng(4)
    y, x = (np.indices((16, 16)) + 0.5) / 16
    exposure = level * (0.3 + x) * (np.hypot(x - 0.5, y - 0.5) < 0.5)
    counts = rng.poisson(exposure * np.exp(np.sin(5 * y))).astype(np.float64)
    centres = (np.arange(16) + 0.5) / 16
    fitted = exposure * fit(counts, exposure, (8, 8)).rate(centres, centres)
    assert fitted.sum() == pytest.approx(counts.sum(), rel=1e-3)


def test_structure_that_the_photons_show_is_followed():
    y, x = (np.indices((512, 512)) + 0.5) / 512
    expected = 1.78 * np.exp(0.4 * np.sin(7 * x) * np.cos(5 * y))
    background = mapped(np.random.default_rng(5).poisson(expected))
    assert np.std(background / expected) < 0.03


def test_no_over_or_undershoot_in_a_large_hole():
    y, x = (np.indices((16, 16)) + 0.5) / 16
    exposure = np.where(np.hypot(x - 0.4, y - 0.6) < 0.28, 0.0, 180.0)
    counts = np.random.default_rng(6).poisson(exposure * (1.0 + 0.5 * x)).astype(np.float64)
    centres = (np.arange(16) + 0.5) / 16
    rate = fit(counts, exposure, (8, 8)).rate(centres, centres)
    assert np.abs(rate / (1.0 + 0.5 * x) - 1.0)[exposure == 0].max() < 0.12


@pytest.mark.parametrize("method", ["spline", "model"])
def test_cells_with_an_uncut_excess_are_left_out(method):
    counts = np.random.default_rng(7).poisson(0.178, (512, 512))
    counts[256:288, 256:288] += np.random.default_rng(8).poisson(0.178, (32, 32))
    background = mapped(counts, background=method)
    assert background[272, 272] == pytest.approx(0.178, rel=0.06)


def test_sources_hardly_raise_the_map_but_halos_do():
    rng = np.random.default_rng(9)
    places = [(x, y, 1000.0) for x in range(64, 512, 128) for y in range(64, 512, 128)]
    points = mapped(photon_image(rng, 0.178, places))
    # 16 000 photons are a third of the background; 6 % of them lie beyond the circles of 35″
    assert np.median(points) / 0.178 < 1.12
    halo = mapped(photon_image(rng, 0.178, [(255.0, 255.0, 3000.0)], cluster_core_arcsec=120.0))
    assert halo[255, 255] > 1.3 * halo[20, 20]


@pytest.mark.parametrize("method", METHODS)
def test_candidates_everywhere_leave_enough_for_a_map(method):
    counts = np.random.default_rng(10).poisson(3000.0, (128, 128))
    background = mapped(counts, background=method)
    assert background.mean() == pytest.approx(3000.0, rel=0.02)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(1, 1), (3, 40), (64, 200)])
def test_small_images_and_hardly_any_photons_give_positive_maps(method, shape):
    for photons in (0, 1, 40):
        counts = np.zeros(shape, np.int32)
        counts.flat[:photons] = 1
        exposure = np.full(shape, 1e4)
        exposure[-1, -1] = 0.0
        background = mapped(counts, exposure, background=method)
        assert np.all(np.isfinite(background))
        assert np.all((background > 0.0) == (exposure > 0.0))


@pytest.mark.parametrize("method", METHODS)
def test_turning_the_image_turns_the_map(method):
    counts = photon_image(np.random.default_rng(11), 0.178, [(40.0, 200.0, 500.0)], 256)
    turned = mapped(np.rot90(counts).copy(), background=method)
    np.testing.assert_allclose(np.rot90(mapped(counts, background=method)), turned, rtol=1e-3)


def test_a_granted_map_is_taken_and_must_be_there():
    with pytest.raises(ValueError, match="granted"):
        mapped(np.zeros((64, 64), np.int32), background="granted")
    exposure = np.full((64, 64), 1e4)
    exposure[:10] = 0.0
    granted = np.linspace(0.1, 0.5, 64 * 64).reshape(64, 64)
    observation = replace(observe(np.zeros((64, 64), np.int32), exposure), background=granted)
    cells = sliding_cell(observation, None, SlidingCellParams())
    background = background_map(observation, cells, CheeseSplineParams(background="granted"))
    np.testing.assert_array_equal(background, np.where(exposure > 0, granted, 0.0))
