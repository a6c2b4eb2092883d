"""Tables of source shapes against two-dimensional integrals, and the pixels they are put on."""

from __future__ import annotations

import numpy as np
import pytest
from detect_fields import SCALE_ARCSEC, TestPsf
from ml_problems import PSF, exact_pixels, problem_of, source_rows, square_images
from scipy import integrate

from survey_mc.detect._eml import fit as ml_fit
from survey_mc.detect._eml import psf_table
from survey_mc.detect._eml.pixels import Images, add_model, collect, observed_share, parts_of
from survey_mc.detect._eml.selection import (
    solve,
)

Z = 4.0  # two-sided odds of 6e-5 for each comparison


@pytest.fixture(scope="module")
def table():
    return psf_table.psf_table(PSF, SCALE_ARCSEC, "beta")


def test_table_is_the_pixel_integral_to_half_a_percent(table):
    for dx, dy in ((0.0, 0.0), (0.3, -0.2), (0.5, 0.5), (0.5, 0.0)):
        exact = exact_pixels(9, dx, dy)
        images = square_images(np.zeros((19, 19)), 1.0)
        source = source_rows((9.0 + dx, 9.0 + dy, 1.0))
        pixels = collect(images, source, 30.0)
        model = parts_of(source, pixels, table.cubics)[0].reshape(19, 19)
        assert np.abs(model / exact - 1.0).max() < 0.006


def test_shapes_contain_all_photons(table):
    radius = np.arange(table.cubics.shape[1]) / ml_fit.STEPS_PER_PIX
    inside = integrate.simpson(2.0 * np.pi * radius * table.cubics[:, :, 0], x=radius, axis=1)
    reach = np.array(psf_table.REACH_PIX * SCALE_ARCSEC)
    assert inside[0] == pytest.approx(float(PSF.encircled_energy(reach)), abs=1e-3)
    beyond_beta = 1.0 / np.sqrt(1.0 + (psf_table.REACH_PIX / table.extent_pix) ** 2)
    beyond = 1.0 - float(PSF.encircled_energy(reach)) + beyond_beta
    assert np.abs(1.0 - inside[1:] - beyond).max() < 0.003


@pytest.mark.parametrize("kind", ["beta", "gaussian"])
def test_extended_shape_is_the_convolution(kind):
    rng = np.random.default_rng(401)
    table = psf_table.psf_table(PSF, SCALE_ARCSEC, kind)
    row = int(np.argmin(np.abs(table.extent_pix - 3.0)))
    extent, n = table.extent_pix[row], 2_000_000
    psf_radius = 3.812 / SCALE_ARCSEC * np.sqrt((1.0 - rng.random(n)) ** (1.0 / (1.0 - 1.4377)) - 1.0)
    own = rng.random(n)
    shape_radius = extent * (np.sqrt((1 - own) ** -2 - 1) if kind == "beta" else np.sqrt(-2.0 * np.log1p(-own)))
    angle = rng.uniform(0.0, 2.0 * np.pi, (2, n))
    x = psf_radius * np.cos(angle[0]) + shape_radius * np.cos(angle[1]) + rng.uniform(-0.5, 0.5, n)
    y = psf_radius * np.sin(angle[0]) + shape_radius * np.sin(angle[1]) + rng.uniform(-0.5, 0.5, n)
    edges = np.array([0.0, 1.0, 2.0, 4.0, 7.0, 12.0, 20.0, 40.0])
    drawn = np.histogram(np.hypot(x, y), edges)[0] / n
    radius = np.arange(table.cubics.shape[1]) / ml_fit.STEPS_PER_PIX
    density = 2.0 * np.pi * radius * table.cubics[row + 1, :, 0]
    inside = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2.0 / ml_fit.STEPS_PER_PIX)])
    expected = np.diff(np.interp(edges, radius, inside))
    # 7 comparisons at 4σ and half a per mille for the quadrature
    assert (np.abs(drawn - expected) < Z * np.sqrt(expected / n) + 5e-4).all()
    half = np.median(np.hypot(x, y))
    assert table.r50_pix[row + 1] == pytest.approx(half, rel=0.005)


def test_table_is_made_once_for_equal_psfs():
    again = psf_table.psf_table(TestPsf(), SCALE_ARCSEC, "beta")
    assert again is psf_table.psf_table(PSF, SCALE_ARCSEC, "beta")
    assert again is not psf_table.psf_table(TestPsf(slope=1.6), SCALE_ARCSEC, "beta")
    assert not again.cubics.flags.writeable


def test_circular_table_biases_neither_position_nor_counts(table):
    for dx, dy in ((0.0, 0.0), (0.25, 0.25), (0.5, 0.0), (0.4, 0.1)):
        expected = 0.05 + 1e4 * exact_pixels(17, dx, dy, 12)
        solution = solve(source_rows((17.1, 16.9, 8e3)), problem_of(expected, 0.05, table)).sources[0]
        assert np.abs(solution[:2] - [17.0 + dx, 17.0 + dy]).max() < 0.003
        assert solution[2] == pytest.approx(1e4, rel=0.003)


def test_pixels_of_overlapping_discs_come_once_and_only_where_observed():
    exposure = np.ones((30, 40))
    exposure[10:12] = 0.0
    images = Images(np.arange(1200.0).reshape(30, 40), np.ones((30, 40)), exposure)
    sources = source_rows((5.2, 8.7, 1.0), (7.9, 9.1, 1.0), (38.0, 28.0, 1.0))
    pixels = collect(images, sources, 4.3)
    y, x = np.mgrid[:30, :40]
    near = np.zeros((30, 40), bool)
    for source in sources:
        near |= np.hypot(x - source[0], y - source[1]) <= 4.3
    expected = np.sort(images.counts[near & (exposure > 0.0)])
    assert np.array_equal(np.sort(pixels[ml_fit.PIX_COUNTS]), expected)


def test_a_model_taken_away_leaves_the_background_as_it_was(table):
    images = square_images(np.zeros((40, 40)), 0.2)
    source = source_rows((15.3, 20.8, 300.0))[0]
    add_model(images, source, table.cubics, 0.002)
    assert images.background.max() > 10.0
    add_model(images, source, table.cubics, 0.002, sign=-1.0)
    assert np.allclose(images.background, 0.2, atol=1e-12)


def test_observed_share_is_half_for_a_source_on_the_edge(table):
    exposure = np.ones((40, 40))
    exposure[:, 20:] = 0.0
    share = observed_share(exposure, source_rows((19.5, 20.0, 1.0))[0], table.cubics, 6.0)
    assert share == pytest.approx(0.5, abs=0.01)
    assert observed_share(exposure, source_rows((9.0, 20.0, 1.0))[0], table.cubics, 6.0) == 1.0
