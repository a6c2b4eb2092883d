"""The sliding cell against closed forms and against a slow, plain implementation."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from detect_fields import TestPsf, grid_positions, observe, photon_image
from scipy.ndimage import distance_transform_edt, maximum_filter
from scipy.stats import poisson

from survey_mc.detect._eml.sliding_cell import Cells, SlidingCellParams, largest_means, sliding_cell
from survey_mc.detect._eml.sliding_cell_kernels import minus_log_tail
from survey_mc.detect._eml.sliding_cell_measures import psf_stamp
from survey_mc.telescope.psf import KingPsf, pixel_image

Z_1E4 = 3.9  # two-sided 1e-4
BACKGROUNDS = {"10ks": 0.178, "100ks": 1.78}


def box_fraction(stamp: np.ndarray, side: int) -> float:
    middle, half = stamp.shape[0] // 2, side // 2
    return float(stamp[middle - half : middle + half + 1, middle - half : middle + half + 1].sum())


def plain_candidates(counts, exposure, background, box, like_min):
    """(LIKE, counts in the box) of all local maxima of one run, straight from the definition, sorted."""
    height, width = counts.shape
    half = box // 2
    seen = counts * (exposure > 0)
    means, sums = np.ones(counts.shape), np.zeros(counts.shape)
    for y in range(height):
        for x in range(width):
            if exposure[y, x] <= 0:
                continue
            rows, columns = slice(max(y - half, 0), y + half + 1), slice(max(x - half, 0), x + half + 1)
            k = seen[rows, columns].sum()
            if background is not None:
                mean = background[rows, columns].sum()
            else:
                rows2 = slice(max(y - half - 2, 0), y + half + 3)
                columns2 = slice(max(x - half - 2, 0), x + half + 3)
                frame = exposure[rows2, columns2].sum() - exposure[rows, columns].sum()
                photons = seen[rows2, columns2].sum() - k
                mean = max(photons, 1) * exposure[rows, columns].sum() / frame
            means[y, x], sums[y, x] = mean, k
    like = np.where(sums > means, -poisson.logsf(sums - 1, means), 0.0)
    best = (like >= like_min) & (like == maximum_filter(like, box, mode="constant"))
    return like[best], sums[best], np.nonzero(best)


def vignetted(shape):
    y, x = np.indices(shape)
    return 1e4 / (1.0 + ((x - shape[1] / 3) ** 2 + (y - shape[0] / 1.7) ** 2) / 150.0**2)


@pytest.mark.parametrize("side", [3, 5, 9])
def test_psf_fractions_are_those_of_a_source_anywhere_in_its_pixel(side):
    offsets = (np.arange(8) + 0.5) / 8 - 0.5
    mean = np.mean([pixel_image(TestPsf(), 4.0, side // 2, x, y).sum() for x in offsets for y in offsets])
    assert box_fraction(psf_stamp(TestPsf(), 4.0, 10), side) == pytest.approx(mean, abs=3e-4)


def test_the_box_holds_62_percent_and_the_frame_15_percent_of_the_papers_psf():
    box, outer = (box_fraction(psf_stamp(TestPsf(), 4.0, 10), side) for side in (5, 9))
    assert (box, outer - box) == pytest.approx((0.623, 0.1456), abs=1e-3)


def test_psf_much_narrower_than_a_pixel_stays_in_its_pixel_and_the_next():
    stamp = psf_stamp(KingPsf.from_fwhm_hew(0.5, 0.6), 4.0, 6)
    assert box_fraction(stamp, 3) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("mean", [1e-3, 0.3, 4.45, 44.5, 900.0])
def test_minus_log_tail_is_the_logarithm_of_the_poisson_tail(mean):
    k = np.unique(np.ceil(mean + np.sqrt(mean + 1) * np.linspace(0.1, 12, 40))).astype(int)
    expected = -poisson.logsf(k - 1, mean)
    ours = np.array([minus_log_tail(int(n), mean) for n in k])
    finite = np.isfinite(expected)
    assert finite.sum() > 5
    np.testing.assert_allclose(ours[finite], expected[finite], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("k", "mean"), [(300_000, 4.45), (5000, 44.5), (100, 1e-9)])
def test_minus_log_tail_does_not_underflow(k, mean):
    first_term = mean - k * math.log(mean) + math.lgamma(k + 1)
    assert first_term + math.log1p(-mean / (k + 1)) <= minus_log_tail(k, mean) <= first_term


def test_the_table_of_means_lets_exactly_the_significant_cells_pass():
    limits = largest_means(8.0)
    for k in (1, 5, 20, 300, 4000):
        assert -poisson.logsf(k - 1, limits[k] * 0.999) > 8.0
        assert -poisson.logsf(k - 1, limits[k] * 1.001) < 8.0


@pytest.mark.parametrize(
    ("background", "like", "counts"),
    [
        (0.178, 6.6, 13.7),
        (0.178, 8.0, 15.4),
        (0.178, 10.0, 18.6),
        (1.78, 6.6, 36.2),
        (1.78, 8.0, 41.0),
        (1.78, 10.0, 47.4),
    ],
)
def test_least_detectable_counts(background, like, counts):
    share, mean = box_fraction(psf_stamp(TestPsf(), 4.0, 6), 5), 25 * background
    least_in_box = np.argmax(largest_means(like) >= mean)
    assert (least_in_box - mean) / share == pytest.approx(counts, rel=5e-3)


@pytest.mark.parametrize("background", BACKGROUNDS.values(), ids=BACKGROUNDS)
@pytest.mark.parametrize("box", [3, 5])
def test_map_mode_finds_what_the_definition_says_in_blank_fields_with_masks(background, box):
    exposure = vignetted((96, 130))
    exposure[40:43], exposure[:, 100:105], exposure[80:, :30] = 0.0, 0.0, 0.0
    expected = background * exposure / 1e4
    counts = np.random.default_rng(7).poisson(background, exposure.shape)
    params = SlidingCellParams(n_runs=1, box_pix=box, like_min_map=3.0)
    cells = sliding_cell(observe(counts, exposure), expected, params)
    like, sums, _ = plain_candidates(counts, exposure, expected, box, 3.0)
    np.testing.assert_allclose(cells.like, np.sort(like)[::-1], atol=2e-6)
    np.testing.assert_array_equal(cells.box_counts, sums[np.argsort(-like)])


@pytest.mark.parametrize("background", BACKGROUNDS.values(), ids=BACKGROUNDS)
@pytest.mark.parametrize("box", [3, 5])
def test_local_mode_finds_what_the_definition_says_away_from_the_border(background, box):
    exposure = vignetted((110, 120))
    counts = np.random.default_rng(8).poisson(background * exposure / 1e4)
    cells = sliding_cell(observe(counts, exposure), None, SlidingCellParams(n_runs=1, box_pix=box, like_min_local=4.0))
    like, _, (row, column) = plain_candidates(counts, exposure, None, box, 4.0)
    inside = (row > 9) & (row < 100) & (column > 9) & (column < 110)
    assert sum(np.abs(cells.like - value).min() < 2e-6 for value in like[inside]) == inside.sum() > 20
    deep = (cells.x_pix > 13) & (cells.x_pix < 106) & (cells.y_pix > 13) & (cells.y_pix < 96)
    assert all(np.abs(like - value).min() < 2e-6 for value in cells.like[deep])


@pytest.mark.parametrize("mode", ["local", "map"])
def test_masks_and_borders_give_no_excess_of_candidates(mode):
    exposure = vignetted((300, 300))
    y, x = np.indices(exposure.shape)
    exposure[np.hypot(x - 150, y - 150) > 140] = 0.0
    exposure[:, 80:84], exposure[200:206, :] = 0.0, 0.0
    depth = distance_transform_edt(np.pad(exposure > 0, 1))[1:-1, 1:-1]
    found = []
    params = SlidingCellParams(like_min_local=6.0, like_min_map=4.0)
    for seed in range(8):
        expected = 0.3 * exposure / 1e4
        counts = np.random.default_rng(seed).poisson(expected)
        cells = sliding_cell(observe(counts, exposure), expected if mode == "map" else None, params)
        found.append(depth[np.rint(cells.y_pix).astype(int), np.rint(cells.x_pix).astype(int)])
    distance = np.concatenate(found)
    outermost, edge, inner = ((depth > a) & (depth <= b) for a, b in ((0, 2), (2, 8), (8, 999)))
    n_edge, n_inner = np.sum((distance > 2) & (distance <= 8)), np.sum(distance > 8)
    expected_edge = n_inner * edge.sum() / inner.sum()
    # 1e-4 false alarm, two-sided, if the density near the edges is that of the middle
    assert abs(n_edge - expected_edge) < Z_1E4 * math.sqrt(expected_edge * (1 + expected_edge / n_inner))
    assert np.sum(distance <= 2) < n_inner * outermost.sum() / inner.sum()


@pytest.mark.parametrize("mode", ["local", "map"])
def test_counts_and_positions_of_isolated_sources_are_unbiased_and_their_errors_right(mode):
    pulls, ratios = [], []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        places = grid_positions(10, 512, rng)
        counts = photon_image(rng, 0.178, [(x, y, 1000.0) for x, y in places])
        background = np.full(counts.shape, 0.178) if mode == "map" else None
        cells = sliding_cell(observe(counts), background, SlidingCellParams(n_runs=1))
        for x, y in places:
            i = np.hypot(cells.x_pix - x, cells.y_pix - y).argmin()
            ratios.append(cells.counts[i] / 1000.0)
            pulls.append(
                [
                    (cells.counts[i] - 1000.0) / cells.counts_err[i],
                    (cells.x_pix[i] - x) / cells.x_err_pix[i],
                    (cells.y_pix[i] - y) / cells.y_err_pix[i],
                ]
            )
    pulls = np.array(pulls)
    # 1e-4 two-sided, and half a percent for the choice of the likeliest box
    assert abs(np.mean(ratios) - 1.0) < Z_1E4 * np.std(ratios) / math.sqrt(len(ratios)) + 0.005
    assert np.all(np.abs(pulls[:, 1:].mean(axis=0)) < Z_1E4 / math.sqrt(len(pulls)))
    # ± 3.9 of the relative error 1/√2n of a standard deviation, and a tenth for what the moments leave out
    assert np.all(np.abs(pulls.std(axis=0) - 1.0) < Z_1E4 / math.sqrt(2 * len(pulls)) + 0.1)


def test_counts_are_those_of_the_exposure_at_the_source():
    rng = np.random.default_rng(5)
    share = np.broadcast_to(np.linspace(1.0, 0.2, 512), (512, 512))
    places = grid_positions(8, 512, rng)
    counts = rng.binomial(photon_image(rng, 0.178, [(x, y, 2000.0) for x, y in places]), share)
    ratios = []
    for background in (0.178 * share, None):
        cells = sliding_cell(observe(counts, share * 1e4), background, SlidingCellParams(n_runs=1))
        for x, y in places:
            i = np.hypot(cells.x_pix - x, cells.y_pix - y).argmin()
            ratios.append(cells.counts[i] / (2000.0 * np.interp(x, np.arange(512), share[0])))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.015)


def test_half_a_source_at_a_gap_still_gives_its_counts():
    rng = np.random.default_rng(6)
    places = [(x, y, 3000.0) for x in (60.0, 160.0, 260.0) for y in np.arange(30.0, 290.0, 32.0)]
    counts, exposure = photon_image(rng, 0.178, places, 300), np.full((300, 300), 1e4)
    for x, _, _ in places:
        exposure[:, int(x) + 1 : int(x) + 5] = 0.0
    cells = sliding_cell(observe(counts, exposure), 0.178 * (exposure > 0), SlidingCellParams(n_runs=1))
    nearest = [np.hypot(cells.x_pix - x, cells.y_pix - y).argmin() for x, y, _ in places]
    assert np.median(cells.counts[nearest]) == pytest.approx(3000.0, rel=0.1)
    assert exposure[np.rint(cells.y_pix).astype(int), np.rint(cells.x_pix).astype(int)].min() > 0.0


def test_a_pair_beyond_the_box_is_two_candidates_and_not_their_blend():
    rng = np.random.default_rng(3)
    counts = photon_image(rng, 0.178, [(60.0, 64.0, 300.0), (67.5, 64.0, 300.0)], 128)
    cells = sliding_cell(observe(counts), np.full(counts.shape, 0.178), SlidingCellParams(like_min_map=10.0))
    assert sorted(np.round(cells.x_pix[:2] / 7.5)) == [8.0, 9.0]
    assert np.all(cells.box_size_pix[:2] == 5.0)


def test_a_faint_wide_source_is_found_by_a_binned_run():
    rng = np.random.default_rng(4)
    y, x = np.indices((128, 128))
    halo = 150.0 / (2 * np.pi * 6.0**2) * np.exp(-0.5 * ((x - 70) ** 2 + (y - 50) ** 2) / 6.0**2)
    counts = rng.poisson(0.178 + halo)
    likeliest = {}
    for n_runs in (1, 3):
        cells = sliding_cell(observe(counts), np.full(counts.shape, 0.178), SlidingCellParams(n_runs=n_runs))
        likeliest[n_runs] = cells.like.max(initial=0.0)
    assert likeliest[3] > likeliest[1] + 10.0
    assert cells.box_size_pix[0] > 5.0
    assert math.hypot(cells.x_pix[0] - 70, cells.y_pix[0] - 50) < 4.0


def assert_same(a, b, x, y):
    order, other = np.lexsort((a.x_pix, a.y_pix, -a.like)), np.lexsort((x, y, -b.like))
    np.testing.assert_allclose(x[other], a.x_pix[order], atol=1e-6)
    np.testing.assert_allclose(y[other], a.y_pix[order], atol=1e-6)
    np.testing.assert_allclose(b.counts[other], a.counts[order], rtol=1e-6)
    np.testing.assert_array_equal(b.box_size_pix[other], a.box_size_pix[order])


@pytest.mark.parametrize("cell_step", ["binned_pixel", "pixel"])
@pytest.mark.parametrize("mode", ["local", "map"])
def test_turning_the_image_turns_the_candidates(mode, cell_step):
    rng = np.random.default_rng(9)
    counts = photon_image(rng, 0.178, [(40.3, 90.8, 200.0), (7.0, 100.0, 80.0)], 128)
    params = SlidingCellParams(cell_step=cell_step)
    background = np.full(counts.shape, 0.178) if mode == "map" else None
    cells = sliding_cell(observe(counts), background, params)
    turned = sliding_cell(observe(np.rot90(counts).copy()), background, params)
    assert_same(cells, turned, 127.0 - turned.y_pix, turned.x_pix)


@pytest.mark.parametrize(("cell_step", "shift"), [("binned_pixel", 4), ("pixel", 3)])
def test_moving_the_image_moves_the_candidates(cell_step, shift):
    rng = np.random.default_rng(10)
    counts = np.zeros((160, 160), np.int32)
    counts[30:110, 30:120] = photon_image(rng, 0.3, [(40.3, 50.8, 200.0)], 128)[:80, :90]
    exposure = np.zeros(counts.shape)
    exposure[30:110, 30:120] = 1e4
    params = SlidingCellParams(cell_step=cell_step, like_min_local=6.0)
    cells = sliding_cell(observe(counts, exposure), None, params)
    rolled = [np.roll(image, (shift, 2 * shift), axis=(0, 1)) for image in (counts, exposure)]
    moved = sliding_cell(observe(*rolled), None, params)
    assert len(cells) > 10
    assert_same(cells, moved, moved.x_pix - 2 * shift, moved.y_pix - shift)


def test_a_very_bright_source_and_a_hot_pixel_have_finite_likelihoods():
    rng = np.random.default_rng(11)
    counts = photon_image(rng, 0.178, [(100.2, 80.4, 3e5)], 160)
    counts[20, 20] = 2_000_000
    for background in (None, np.full(counts.shape, 0.178)):
        cells = sliding_cell(observe(counts), background, SlidingCellParams(n_runs=4))
        assert all(np.all(np.isfinite(getattr(cells, field.name))) for field in fields(Cells))
        assert cells.like[0] > 1e6
        assert (round(cells.x_pix[0]), round(cells.y_pix[0])) == (20, 20)


@pytest.mark.parametrize("shape", [(1, 1), (3, 40), (64, 100)])
@pytest.mark.parametrize("cell_step", ["binned_pixel", "pixel"])
def test_small_empty_and_unobserved_images_give_no_candidates(shape, cell_step):
    params = SlidingCellParams(n_runs=4, cell_step=cell_step)
    counts = np.zeros(shape, np.int32)
    counts[0, 0] = 1
    for exposure in (np.zeros(shape), np.full(shape, 1e4)):
        assert len(sliding_cell(observe(counts, exposure), None, params)) == 0
        assert len(sliding_cell(observe(counts, exposure), np.full(shape, 0.2) * (exposure > 0), params)) == 0


def test_an_even_box_is_refused():
    with pytest.raises(ValueError, match="box_pix must be odd"):
        SlidingCellParams(box_pix=4)
