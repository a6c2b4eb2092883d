"""Hills of a flux image and what is summed over them, against a slow descending flood."""

from __future__ import annotations

import numpy as np
import pytest
from detect_fields import SCALE_ARCSEC, TestPsf
from scipy.ndimage import gaussian_filter

from survey_mc.detect._wavdetect import source_cells as kernels
from survey_mc.detect._wavdetect.source_measures import FluxImage, measured_cells, principal_axes

FLOOR = 1e-3


def flooded_hills(flux):
    """Hill top (flat index) of every pixel, by lowering the water: each pixel joins its highest wet neighbour."""
    height, width = flux.shape
    label = np.full(flux.shape, -1)
    order = sorted((-flux[y, x], y * width + x) for y in range(height) for x in range(width) if flux[y, x] > -np.inf)
    for _, at in order:
        y, x = divmod(at, width)
        wet = [
            (-flux[v, u], v * width + u)
            for v in range(max(y - 1, 0), min(y + 2, height))
            for u in range(max(x - 1, 0), min(x + 2, width))
            if label[v, u] >= 0
        ]
        label[y, x] = label.ravel()[min(wet)[1]] if wet else at
    return label


def noise(seed, shape=(40, 53)):
    rng = np.random.default_rng(seed)
    return gaussian_filter(rng.poisson(0.3, shape).astype(float), 1.2).astype(np.float32) - np.float32(0.3)


@pytest.mark.parametrize("seed", range(4))
def test_climbing_gives_the_hills_of_a_descending_flood(seed):
    flux = noise(seed)
    assert np.array_equal(kernels.hill_tops(flux).reshape(flux.shape), flooded_hills(flux))


def test_plateaus_and_holes_give_the_hills_of_a_descending_flood():
    rng = np.random.default_rng(9)
    flux = rng.integers(0, 4, (30, 31)).astype(np.float32)
    flux[rng.random(flux.shape) < 0.15] = -np.inf
    top = kernels.hill_tops(flux).reshape(flux.shape)
    assert np.array_equal(top == -1, flux == -np.inf)
    # On a plateau the flood goes by pixel number, a climber by his first neighbour: both end on equal heights.
    seen = top >= 0
    flat = flux.ravel()
    assert np.array_equal(flat[top[seen]] >= flux[seen], np.ones(seen.sum(), bool))
    assert np.array_equal(top.ravel()[top[seen]], top[seen])


def test_two_sources_are_parted_at_their_saddle_and_fill_their_component():
    y, x = np.mgrid[:21, :41]
    hills = sum(np.exp(-((x - x0) ** 2 + (y - 10.0) ** 2) / 18.0) for x0 in (13.0, 25.0))
    flux = hills.astype(np.float32) - np.float32(0.05)
    top = kernels.hill_tops(flux)
    roots = np.array([10 * 41 + 13, 10 * 41 + 25], np.int32)
    owner = kernels.cell_owners(flux, top, roots, FLOOR)
    assert np.array_equal(owner >= 0, flux > FLOOR)
    assert set(np.unique(owner[:, :19])) <= {-1, 0}
    assert set(np.unique(owner[:, 20:])) <= {-1, 1}


def cells_of_image(photons, background=0.3, sigma_pix=1.2):
    flux = gaussian_filter(photons.astype(float), sigma_pix).astype(np.float32) - np.float32(background)
    image = FluxImage(
        flux, FLOOR, sigma_pix, photons.astype(np.float32), np.full(photons.shape, background, np.float32), np.inf
    )
    top = kernels.hill_tops(flux)
    return image, top, kernels


def test_measures_are_the_sums_over_the_cell():
    rng = np.random.default_rng(3)
    photons = rng.poisson(0.3, (40, 50))
    photons[20, 30] += 60
    photons[22, 31] += 30
    image, top, _ = cells_of_image(photons)
    cell = np.array([top[20 * 50 + 30], top[5 * 50 + 5]], np.int64)
    found = measured_cells(image, top, cell, TestPsf(), SCALE_ARCSEC, net_centroid=False)
    for i in range(2):
        inside = (top.reshape(image.flux.shape) == cell[i]) & (image.flux > FLOOR)
        y, x = np.nonzero(inside)
        light = photons[inside]
        assert found["n_pix"][i] == inside.sum()
        assert found["counts"][i] == pytest.approx(light.sum() - 0.3 * inside.sum(), rel=1e-5)
        assert found["counts_err"][i] == pytest.approx(np.sqrt(light.sum()))
        assert found["x_pix"][i] == pytest.approx(np.average(x, weights=light))
        assert found["y_pix"][i] == pytest.approx(np.average(y, weights=light))
        variance = np.average((x - found["x_pix"][i]) ** 2, weights=light)
        assert found["x_err_photons"][i] == pytest.approx(np.sqrt(max(variance, 1 / 12) / light.sum()))


def test_net_centroid_leaves_the_background_out():
    photons = np.zeros((40, 40), int)
    photons[18:23, 18:23] = 20
    image, top, _ = cells_of_image(photons + 1, background=1.0)
    cell = np.array([top[20 * 40 + 20]], np.int64)
    found = measured_cells(image, top, cell, TestPsf(), SCALE_ARCSEC, net_centroid=True)
    assert found["x_pix"][0] == pytest.approx(20.0, abs=1e-4)
    assert found["counts"][0] == pytest.approx(500.0, rel=1e-4)


def test_half_count_radius_of_a_disc():
    y, x = np.mgrid[:61, :61]
    photons = np.where(np.hypot(x - 30, y - 30) < 12.0, 50, 0)
    image, top, _ = cells_of_image(photons, background=0.0, sigma_pix=4.0)
    cell = np.array([top[30 * 61 + 30]], np.int64)
    found = measured_cells(image, top, cell, TestPsf(), SCALE_ARCSEC, net_centroid=True)
    assert found["r50_arcsec"][0] == pytest.approx(SCALE_ARCSEC * 12.0 / np.sqrt(2.0), rel=0.02)


def test_cell_that_is_a_disc_holds_the_psf_of_the_disc():
    y, x = np.mgrid[:61, :61]
    flux = np.where(np.hypot(x - 30, y - 30) < 6.0, 10.0 - 0.1 * np.hypot(x - 30, y - 30), -1.0).astype(np.float32)
    photons = np.where(flux > 0, 5, 0)
    image = FluxImage(flux, FLOOR, 1.4, photons.astype(np.float32), np.zeros((61, 61), np.float32), np.inf)
    found = measured_cells(
        image, kernels.hill_tops(flux), np.array([30 * 61 + 30]), TestPsf(), SCALE_ARCSEC, net_centroid=True
    )
    radius = np.sqrt((flux > 0).sum() / np.pi) * SCALE_ARCSEC
    assert found["psf_share"][0] == pytest.approx(TestPsf().encircled_energy(np.array([radius]))[0], abs=0.01)


def test_edges_and_neighbours_are_noticed():
    flux = noise(5)
    flux[10:12, 20:23] = -np.inf
    top = kernels.hill_tops(flux)
    roots = np.unique(top[(top >= 0) & (flux.ravel() > FLOOR)])
    owner = kernels.cell_owners(flux, top, roots.astype(np.int32), FLOOR)
    peak = np.stack([roots % 53, roots // 53], axis=1).astype(float)
    zero = np.zeros(flux.shape, np.float32)
    _, touches = kernels.cell_sums(owner, zero, zero, flux, peak)
    for i in range(len(roots)):
        y, x = np.nonzero(owner == i)
        near = {
            (int(v), int(u)) for a, b in zip(y, x, strict=True) for v in (a - 1, a, a + 1) for u in (b - 1, b, b + 1)
        }
        beyond = any(not (0 <= v < 40 and 0 <= u < 53) for v, u in near)
        inner = [(v, u) for v, u in near if 0 <= v < 40 and 0 <= u < 53]
        at_edge = beyond or any(flux[p] == -np.inf for p in inner)
        at_source = any(owner[p] not in (-1, i) for p in inner)
        assert (touches[i] & kernels.TOUCHES_EDGE != 0) == at_edge
        assert (touches[i] & kernels.TOUCHES_SOURCE != 0) == at_source


def test_principal_axes_of_a_turned_ellipse():
    angle = np.radians(30.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moments = turn @ np.diag([9.0, 4.0]) @ turn.T
    major, minor, degrees = principal_axes(*(np.array([m]) for m in (moments[0, 0], moments[1, 1], moments[0, 1])))
    assert (major[0], minor[0], degrees[0]) == pytest.approx((3.0, 2.0, 30.0))
