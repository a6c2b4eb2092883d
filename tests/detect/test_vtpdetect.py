"""VTPDETECT: the law of cell areas, the tests of a group, and the behaviour the paper reports."""

from __future__ import annotations

import math

import numpy as np
import pytest
from detect_fields import (
    BACKGROUND_10KS,
    BACKGROUND_100KS,
    EXPOSURE_S,
    grid_positions,
    observe,
    photon_image,
    profile_offsets_pix,
)
from pydantic import ValidationError
from scipy.spatial import cKDTree
from scipy.stats import poisson

from survey_mc.detect import vtpdetect
from survey_mc.detect._vtp import cell_groups
from survey_mc.detect._vtp.params import VtpDetectParams
from survey_mc.detect._vtp.percolation import groups
from survey_mc.detect._vtp.photon_cells import photon_cells
from survey_mc.detect._vtp.poisson_voronoi import fit_faint_cells, flat_density, flux_cdf
from survey_mc.detect.contract import check_detections
from survey_mc.types import Observation, Skip

DETECTOR = vtpdetect.DETECTOR
PAPER, MODERN = DETECTOR.profiles["paper"], DETECTOR.profiles["modern"]
Z = 4.0  # two-sided odds of 6e-5 for each comparison


def detections(image, params=PAPER, seed=0, exposure_s=None):
    observation = observe(image, exposure_s)
    return check_detections(DETECTOR, observation, DETECTOR.detect(observation, params, np.random.default_rng(seed)))


def with_photons(observation, photons_pix):
    return Observation(
        observation.counts,
        photons_pix,
        observation.exposure_s,
        None,
        observation.psf,
        observation.grid,
        observation.band,
    )


def cells_of(image, positions="jitter"):
    observation = observe(image)
    return photon_cells(observation, observation.exposure_s > 0.0, positions, np.random.default_rng(1))


@pytest.mark.parametrize(
    ("k", "expected"),
    [
        (3.5, [0.051, 0.271, 0.429, 0.559, 0.701, 0.835, 0.912, 0.939, 0.986]),
        (4.0, [0.042, 0.265, 0.434, 0.573, 0.721, 0.857, 0.929, 0.954, 0.991]),
    ],
)
def test_law_of_cell_fluxes(k, expected):
    flux = np.array([0.5, 0.8, 1.0, 1.2, 1.5, 2.0, 2.6, 3.0, 5.0])
    np.testing.assert_allclose(flux_cdf(flux, k), expected, atol=6e-4)
    if k == 4.0:
        u = 4.0 / flux
        np.testing.assert_allclose(flux_cdf(flux, k), np.exp(-u) * (1 + u + u**2 / 2 + u**3 / 6), rtol=1e-12)
    assert flux_cdf(np.zeros(1), k) == 0.0


def test_flat_photons_follow_the_law_within_the_known_error_of_its_index():
    cells = cells_of(photon_image(np.random.default_rng(11), BACKGROUND_10KS))
    flux = cells.photons / cells.voronoi.area_pix * (512.0**2 / cells.photons.sum())
    grid = np.linspace(0.3, 5.0, 48)
    counted = np.array([(flux <= f).mean() for f in grid])
    # Sampling error 0.0023 at 47k cells; what remains is the approximation (Γ law with one index).
    assert np.abs(counted - flux_cdf(grid, 3.5)).max() < 0.015
    assert np.abs(counted - flux_cdf(grid, 4.0)).max() < 0.06


@pytest.mark.parametrize(("k", "bias"), [(3.5, 1.01), (4.0, 0.955)])
def test_background_level_survives_a_quarter_of_source_photons(k, bias):
    rng = np.random.default_rng(12)
    sources = [(x, y, 250.0) for x, y in grid_positions(7, 512, rng)]
    cells = cells_of(photon_image(rng, BACKGROUND_10KS, sources))
    photons, area = cells.photons.astype(float), cells.voronoi.area_pix
    density = flat_density(photons, area, k)
    level, _ = fit_faint_cells(photons / (area * density), k, 0.8, 1.5, 1e-6)
    # 6 %: wings of the sources (3 %), noise of the level (0.7 %); `bias` is that of the law on a flat field.
    assert density * level == pytest.approx(bias * BACKGROUND_10KS, rel=0.06)
    assert photons.sum() / area.sum() > 1.2 * BACKGROUND_10KS


def test_smallest_significant_counts():
    expected = np.array([0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0])
    smallest = np.array([8, 10, 13, 20, 29, 46, 88], dtype=float)
    assert cell_groups.exceeds_background(smallest, expected, 1e-6, "total").all()
    assert not cell_groups.exceeds_background(smallest - 1.0, expected, 1e-6, "total").any()
    assert cell_groups.exceeds_background(smallest + expected, expected, 1e-6, "net").all()
    assert not cell_groups.exceeds_background(smallest - 0.01 + expected, expected, 1e-6, "net").any()


def test_significance_is_the_poisson_tail_and_does_not_underflow():
    counts, expected = np.array([2.0, 10.0, 50.0, 3e5]), np.array([0.1, 0.001, 10.0, 1.9e5])
    found = cell_groups.minus_log_tail(counts, expected)
    np.testing.assert_allclose(found[:3], -poisson.logsf(counts[:3] - 1, expected[:3]), rtol=1e-9)
    assert 2.6e4 < found[3] < 2.8e4


def test_percolation_joins_chains_of_bright_neighbours():
    pairs = np.array([[0, 1], [1, 2], [3, 4], [2, 5]], dtype=np.int32)
    bright = np.array([True, True, False, True, True, True])
    np.testing.assert_array_equal(groups(pairs, bright), [0, 0, -1, 1, 1, 2])


def test_insignificant_group_is_trimmed_to_its_bright_core():
    label = np.zeros(30, dtype=np.int32)
    photons = np.append(np.full(3, 8.0), np.ones(27))
    expected = np.append(np.full(3, 0.5), np.full(27, 1.0))
    kept, trimmed = cell_groups.significant_groups(label, photons, expected, photons / expected, 1e-6, 10, "total")
    assert trimmed.tolist() == [True]
    np.testing.assert_array_equal(kept >= 0, np.arange(30) < 3)


def test_ellipse_of_known_moments():
    long_axis, short_axis, angle = cell_groups.ellipse(np.array([2.5, 4.0]), np.array([2.5, 1.0]), np.array([1.5, 0.0]))
    np.testing.assert_allclose(long_axis, [2.0, 2.0])
    np.testing.assert_allclose(short_axis, [1.0, 1.0])
    np.testing.assert_allclose(angle, [45.0, 0.0])


# False detections of blank 512² fields, measured on 20 (10 ks) and 6 (100 ks) fields of other seeds, with their errors.
BLANK_FALSE = [
    (PAPER, BACKGROUND_10KS, 14.5, 0.75, 4),
    (PAPER, BACKGROUND_100KS, 1152.0, 29.0, 1),
    (PAPER.model_copy(update={"positions": "jitter"}), BACKGROUND_100KS, 158.0, 7.0, 1),
    (MODERN, BACKGROUND_10KS, 0.0, 0.1, 3),
    (MODERN, BACKGROUND_100KS, 0.0, 0.2, 1),
]


@pytest.mark.parametrize(("params", "background", "expected", "error", "n_fields"), BLANK_FALSE)
def test_false_detections_of_blank_sky_explode_on_pixel_positions_at_100_ks(
    params, background, expected, error, n_fields
):
    rng = np.random.default_rng(13)
    found = [len(detections(photon_image(rng, background), params, seed)) for seed in range(n_fields)]
    # The cut-off varies from field to field: twice the Poisson scatter.
    assert abs(np.mean(found) - expected) < Z * math.hypot(error, 2.0 * math.sqrt(expected / n_fields)) + 0.5


@pytest.mark.parametrize(("sep_arcsec", "least", "most"), [(30.0, 0, 3), (60.0, 18, 32)])
def test_pairs_of_30_arcsec_are_one_source_and_of_60_arcsec_mostly_two(sep_arcsec, least, most):
    rng = np.random.default_rng(14)
    half_pix = sep_arcsec / 8.0
    split = 0
    for _ in range(2):
        places = grid_positions(4, 512, rng)
        pairs = [(x + side, y, 100.0) for x, y in places for side in (-half_pix, half_pix)]
        found = detections(photon_image(rng, BACKGROUND_10KS, pairs), MODERN)
        found = found[found["counts"] > 30.0]
        near = cKDTree(found[["x_pix", "y_pix"]].to_numpy()).query_ball_point(places, half_pix + 5.0)
        assert all(near), "every pair is seen"
        split += sum(len(members) > 1 for members in near)
    # 2 of 128 pairs at 30″ and 109 of 128 at 60″ in other fields; both bounds have odds below 1e-3.
    assert least <= split <= most


def test_paper_profile_sends_centres_astray():
    rng = np.random.default_rng(15)
    places = grid_positions(7, 512, rng)
    image = photon_image(rng, BACKGROUND_10KS, [(x, y, 100.0) for x, y in places])
    offset = {}
    for name, params in DETECTOR.profiles.items():
        found = detections(image, params)
        distance, _ = cKDTree(found[["x_pix", "y_pix"]].to_numpy()).query(places)
        offset[name] = 4.0 * distance
    assert np.median(offset["paper"]) > 2.5  # arcsec; the photons allow 1.0 (Cramér–Rao, median)
    assert offset["paper"].max() > 8.0
    assert np.median(offset["modern"]) < 1.5


@pytest.mark.parametrize(("counts", "share"), [(200.0, 0.81), (1316.0, 0.83)])
def test_clusters_are_found_whole(counts, share):
    rng = np.random.default_rng(16)
    places = grid_positions(4, 512, rng)
    image = photon_image(rng, BACKGROUND_10KS, [(x, y, counts) for x, y in places], cluster_core_arcsec=30.0)
    found = detections(image)
    distance, nearest = cKDTree(found[["x_pix", "y_pix"]].to_numpy()).query(places)
    near = distance * 4.0 < 20.0
    assert near.sum() >= 13
    row = found.iloc[nearest[near]]
    assert row["counts"].median() / counts == pytest.approx(share, abs=0.12)
    assert row["r50_arcsec"].median() > 25.0


def test_photon_list_is_used_and_its_absence_is_a_skip():
    rng = np.random.default_rng(17)
    source = np.array([60.0, 70.0]) + profile_offsets_pix(rng, 300, 3.8, 1.44)
    photons = np.concatenate([rng.uniform(-0.5, 127.5, (2900, 2)), source])
    column, row = np.rint(photons).astype(int).clip(0, 127).T
    image = np.zeros((128, 128), dtype=np.int32)
    np.add.at(image, (row, column), 1)
    params = MODERN.model_copy(update={"positions": "photons"})
    assert isinstance(DETECTOR.detect(observe(image), params, rng), Skip)
    frames = [DETECTOR.detect(with_photons(observe(image), p.copy()), params, rng) for p in (photons, photons[::-1])]
    assert frames[0].equals(frames[1])
    best = frames[0].iloc[0]
    assert math.hypot(best["x_pix"] - 60.0, best["y_pix"] - 70.0) < 0.5
    # 300 photons, of which the outermost tenth is left to the background; noise 6 %.
    assert 220.0 < best["counts"] < 340.0


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_turned_image_gives_the_same_sources(turns):
    image = photon_image(np.random.default_rng(18), BACKGROUND_100KS, [(40.0, 50.0, 300.0)], 128)
    straight, turned = detections(image), detections(np.rot90(image, turns).copy())
    np.testing.assert_allclose(np.sort(turned["counts"]), np.sort(straight["counts"]), rtol=1e-9)
    np.testing.assert_allclose(np.sort(turned["R_1"]), np.sort(straight["R_1"]), rtol=1e-6)


def test_vignetted_sky_is_flat_with_the_exposure_and_one_large_source_without():
    row, column = np.mgrid[:256, :256]
    share = np.exp(-np.square(np.hypot(row - 127.5, column - 127.5) / 110.0))
    rng = np.random.default_rng(19)
    image = rng.poisson(BACKGROUND_10KS * share).astype(np.int32)
    used = detections(image, exposure_s=EXPOSURE_S * share)
    ignored = detections(image, PAPER.model_copy(update={"use_exposure": False}), exposure_s=EXPOSURE_S * share)
    assert used["counts"].max() < 100.0 or used.empty
    assert ignored["counts"].max() > 300.0


def test_mask_makes_no_sources_and_granted_background_is_used():
    row, column = np.mgrid[:256, :256]
    exposure = np.where(np.hypot(row - 127.5, column - 127.5) < 110.0, EXPOSURE_S, 0.0)
    exposure[:, 120:126] = 0.0
    rng = np.random.default_rng(20)
    image = np.where(exposure > 0.0, photon_image(rng, BACKGROUND_10KS, [(80.0, 100.0, 200.0)], 256), 0)
    plain = observe(image, exposure)
    granted = Observation(
        plain.counts, None, exposure, np.full(image.shape, BACKGROUND_10KS), plain.psf, plain.grid, plain.band
    )
    for params in (MODERN, MODERN.model_copy(update={"background": "granted"})):
        found = DETECTOR.detect(granted, params, np.random.default_rng(0))
        assert len(found) == 1
        assert math.hypot(found["x_pix"][0] - 80.0, found["y_pix"][0] - 100.0) < 1.0
    assert found["background_per_pix"][0] == pytest.approx(BACKGROUND_10KS)


FEW_PHOTONS = {
    "one": [(3, 4, 1)],
    "all in one pixel": [(3, 4, 5000)],
    "three pixels": [(3, 4, 9), (40, 50, 9), (60, 2, 9)],
    "a row": [(x, 30, 3) for x in range(64)],
    "a diagonal": [(x, x, 4) for x in range(64)],
    "everywhere the same": [(x, y, 2) for x in range(64) for y in range(64)],
}


@pytest.mark.parametrize("name", ["paper", "modern"])
@pytest.mark.parametrize("about", FEW_PHOTONS)
def test_degenerate_images_are_survived(about, name):
    image = np.zeros((64, 64), dtype=np.int32)
    for x, y, n in FEW_PHOTONS[about]:
        image[y, x] = n
    frame = detections(image, DETECTOR.profiles[name])
    assert len(frame) <= 5, about
    assert np.isfinite(vtpdetect.density_image(observe(image), DETECTOR.profiles[name])).all()


def test_density_image_gives_back_the_photons_of_a_lattice():
    image = np.random.default_rng(21).poisson(3.0, (40, 50)).astype(np.int32) + 1
    np.testing.assert_array_equal(vtpdetect.density_image(observe(image), PAPER), image)


@pytest.mark.parametrize("shape", [(64, 64), (48, 96)])
@pytest.mark.parametrize("name", ["paper", "modern"])
def test_bright_source_of_a_small_image_with_extreme_parameters(shape, name):
    rng = np.random.default_rng(22)
    image = photon_image(rng, BACKGROUND_10KS, [(30.0, 20.0, 500.0)], 96)[: shape[0], : shape[1]]
    params = DETECTOR.profiles[name]
    assert detections(image, params)["counts"].max() == pytest.approx(500.0, abs=110.0)
    for change in (
        {"scale": 1e-3, "coarse": 1, "limit": 0.5},
        {"edge_pix": 1000},
        {"min_cutoff": 1e-9, "max_cutoff": 1e-8},
        {"max_bkg_flux": 1e-6, "min_tot_flux": 1e-6, "max_tot_flux": 2e-6, "max_iter": 1},
    ):
        detections(image, params.model_copy(update=change))


def test_ranges_must_ascend():
    with pytest.raises(ValidationError, match="min_cutoff must be below max_cutoff"):
        VtpDetectParams(min_cutoff=3.0, max_cutoff=2.0)
