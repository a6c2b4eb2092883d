"""EWAVELET: photometry with and without correction, false detections, masks, clusters, survival."""

from __future__ import annotations

import math

import numpy as np
import pytest
from detect_fields import (
    BACKGROUND_10KS,
    BACKGROUND_100KS,
    EXPOSURE_S,
    TestPsf,
    grid_positions,
    observe,
    photon_image,
)

from survey_mc.detect import check_detections, ewavelet
from survey_mc.detect._ewavelet.hat_ring import hat_ring, ring
from survey_mc.detect._ewavelet.local_maxima import local_maxima
from survey_mc.detect._ewavelet.psf_response import counts_per_photon
from survey_mc.detect.ewavelet import DETECTOR, MODERN, PAPER, PAPER_CORRECTED, EwaveletParams
from survey_mc.types import Observation

PI = math.pi
FALSE_ALARM_SIGMA = 3.9  # two-sided odds of 1e-4


def run(observation, params=PAPER, **changes):
    frame = ewavelet.detect(observation, params.model_copy(update=changes), np.random.default_rng(0))
    return check_detections(DETECTOR, observation, frame)


def nearest(frame, positions):
    distance = np.hypot(
        frame["x_pix"].to_numpy()[:, None] - positions[:, 0], frame["y_pix"].to_numpy()[:, None] - positions[:, 1]
    )
    return frame.iloc[distance.argmin(axis=0)], distance.min(axis=0)


def grid_field(seed, counts, background=BACKGROUND_10KS, n_side=8, n_pix=512, **kind):
    positions = grid_positions(n_side, n_pix, np.random.default_rng(seed))
    image = photon_image(
        np.random.default_rng(seed + 1), background, [(x, y, counts) for x, y in positions], n_pix, **kind
    )
    return positions, image


def gaussian_image(width, half=60):
    offset = np.arange(-half, half + 1)
    r2 = np.square(offset)[:, None] + np.square(offset)
    return np.exp(-0.5 * r2 / width**2) / (2.0 * PI * width**2)


def blank(background, n_fields, seed, params, exposure=None):
    rng = np.random.default_rng(seed)
    share = np.ones((512, 512)) if exposure is None else exposure / EXPOSURE_S
    return [run(observe(rng.poisson(background * share), exposure), params) for _ in range(n_fields)]


def test_ring_has_unit_sum_and_its_scale():
    kernel = ring(4.0)
    offset = np.arange(kernel.shape[0]) - kernel.shape[0] // 2
    r2 = np.square(offset)[:, None] + np.square(offset)
    assert kernel.sum() == pytest.approx(1.0)
    assert kernel[r2 == 0] == 0.0
    # ⟨r²⟩ = 4σ_b², σ_b = 8 pix; the cut at 4σ_b takes 1.4 % of it.
    assert (kernel * r2).sum() == pytest.approx(4.0 * 8.0**2, rel=0.02)


def test_first_of_equal_neighbours_is_the_maximum():
    image = np.zeros((6, 7), np.float32)
    image[2, 3] = image[2, 4] = image[3, 3] = 5.0
    image[5, 6] = 1.0
    assert local_maxima(image, np.float32(0.5)).tolist() == [[2, 3], [5, 6]]
    assert local_maxima(np.full((4, 4), -np.inf, np.float32), np.float32(0.0)).shape == (0, 2)


def test_response_to_a_point_source_grows_with_scale():
    factors = [counts_per_photon(TestPsf(), 4.0, sigma) for sigma in (1.0, 2.0, 4.0, 8.0)]
    np.testing.assert_allclose(factors, (0.60, 1.46, 2.36, 3.03), rtol=0.02)


@pytest.mark.parametrize("counts", [100.0, 1000.0])
def test_points_lose_forty_percent_unless_corrected(counts):
    positions, image = grid_field(31, counts)
    observation = observe(image)
    plain, distance = nearest(run(observation), positions)
    corrected, _ = nearest(run(observation, PAPER_CORRECTED), positions)
    assert distance.max() < 1.5
    assert np.mean(plain["WSCALE"] == 1.0) > 0.95
    scatter = plain["counts"].std() / counts / math.sqrt(len(positions))
    # 0.592 ± noise; the highest of nine noisy pixels is 2 to 6 % above the mean at 100 counts.
    assert abs(plain["counts"].mean() / counts - 0.605) < FALSE_ALARM_SIGMA * scatter + 0.015
    assert abs(corrected["counts"].mean() / counts - 1.02) < (FALSE_ALARM_SIGMA * scatter + 0.015) / 0.592


@pytest.mark.parametrize("counts", [120.0, 1000.0])
def test_errors_are_the_scatter(counts):
    positions, image = grid_field(41, counts)
    found, distance = nearest(run(observe(image)), positions)
    assert distance.max() < 1.5
    offset = found[["x_pix", "y_pix"]].to_numpy() - positions
    pulls = offset / found[["x_err_pix", "y_err_pix"]].to_numpy()
    # 128 pulls of rms 0.86 know it to 6 %; 64 counts and extents know their scatter to 9 %: 3 to 4σ.
    assert 0.66 < np.sqrt(np.square(pulls).mean()) < 1.08
    assert np.abs(offset.mean(axis=0)).max() < 4.0 * offset.std() / 8.0
    assert found["counts"].std() / found["counts_err"].mean() == pytest.approx(1.05, abs=0.33)
    assert found["EXTENT"].std() / found["EXT_ERR"].median() == pytest.approx(1.1, abs=0.4)


def test_gaussian_source_is_measured_with_its_counts_and_width():
    rng = np.random.default_rng(8)
    image = rng.poisson(0.178, (256, 256))
    image[68:189, 68:189] += rng.poisson(4000.0 * gaussian_image(4.0))
    frame = run(observe(image))
    found, distance = nearest(frame[frame["counts"] > 1000.0], np.array([[128.0, 128.0]]))
    row = found.iloc[0]
    assert distance[0] < 0.5
    assert row["WSCALE"] == 4.0
    assert abs(row["counts"] - 4000.0) < FALSE_ALARM_SIGMA * row["counts_err"]
    width = row["EXTENT"] / math.sqrt(8.0 * math.log(2.0))
    assert abs(width - 4.0) < FALSE_ALARM_SIGMA * row["EXT_ERR"] / math.sqrt(8.0 * math.log(2.0)) + 0.05
    assert row["r50_arcsec"] == pytest.approx(math.sqrt(2.0 * math.log(2.0)) * width * 4.0)


# Means of 30 other fields: 57.7 per field for PAPER, 3.6 for MODERN (at both backgrounds). Two-sided odds 1e-4 each.
@pytest.mark.parametrize("background", [BACKGROUND_10KS, BACKGROUND_100KS])
def test_blank_field_has_the_measured_number_of_false_detections(background):
    paper = sum(map(len, blank(background, 4, 71, PAPER)))
    modern = sum(map(len, blank(background, 3, 72, MODERN)))
    assert abs(paper - 4 * 57.7) < FALSE_ALARM_SIGMA * math.sqrt(4 * 57.7)
    assert 1 <= modern <= 26  # Poisson of mean 10.8


def test_flat_background_gives_the_exact_number_of_maxima_per_scale():
    # Maxima above exact 1e-4 thresholds at σ = 1, 2, 4: 24.8, 14.8, 6.1 a field, each scale by itself.
    params = PAPER.model_copy(update={"threshold_kind": "exact", "iterations": 1})
    for sigma, mean in ((1.0, 24.8), (2.0, 14.8), (4.0, 6.1)):
        found = sum(map(len, blank(BACKGROUND_10KS, 4, 73, params.model_copy(update={"scales_pix": (sigma,)}))))
        assert abs(found - 4 * mean) < FALSE_ALARM_SIGMA * math.sqrt(4 * mean) + 0.1 * 4 * mean


@pytest.mark.parametrize("params", [PAPER, MODERN, EwaveletParams(edge_threshold=0.0)])
def test_masks_and_vignetting_add_no_false_detections(params):
    y, x = np.mgrid[:512, :512]
    radius = np.hypot(x - 255.5, y - 255.5)
    exposure = EXPOSURE_S * (1.0 - 0.4 * np.square(radius / 225.0))
    exposure[radius > 225] = 0.0
    exposure[150:153, :] = 0.0
    exposure[:, 300:340] = 0.0
    found = blank(BACKGROUND_100KS, 2, 74, params, exposure)
    share = (exposure > 0).mean()
    expected = 2 * share * (3.6 if params is MODERN else 57.7)
    assert sum(map(len, found)) < expected + FALSE_ALARM_SIGMA * math.sqrt(expected)
    for frame in found:
        assert np.all(exposure[frame["JMAX"], frame["IMAX"]] > 0.0)


def test_cluster_is_found_at_a_larger_scale_and_a_point_on_top_hides_it():
    positions, image = grid_field(51, 1000.0, BACKGROUND_100KS, 4, cluster_core_arcsec=30.0)
    alone, distance = nearest(run(observe(image), MODERN), positions)
    assert distance.max() < 5.0
    # 68 % of such clusters are seen at 4 pix or more (80 tried); fewer than 5 of 16 has odds of 1e-3.
    assert np.sum(alone["WSCALE"] >= 2.8) >= 5
    covered = image + photon_image(np.random.default_rng(3), 0.0, [(x, y, 600.0) for x, y in positions], 512)
    hidden, distance = nearest(run(observe(covered), MODERN), positions)
    assert distance.max() < 1.0
    assert np.all(hidden["WSCALE"] < 2.0)


def test_small_scales_first_breaks_what_highest_correlation_keeps():
    rng = np.random.default_rng(9)
    image = rng.poisson(0.178, (256, 256))
    image[68:189, 68:189] += rng.poisson(3000.0 * gaussian_image(4.0))
    counts = {rule: run(observe(image), merge_rule=rule)["counts"].max() for rule in ("highest", "smallfirst")}
    assert counts["smallfirst"] < 0.5 * counts["highest"]


def test_pairs_are_split_at_thirty_arcsec():
    positions = grid_positions(4, 512, np.random.default_rng(61))
    half_apart = np.array([3.75, 0.0])
    both = np.concatenate([positions - half_apart, positions + half_apart])
    image = photon_image(np.random.default_rng(62), BACKGROUND_10KS, [(x, y, 150.0) for x, y in both])
    _, distance = nearest(run(observe(image)), both)
    assert np.sum(distance < 1.5) >= 31


def test_faint_background_photons_alone_make_no_source():
    image = np.zeros((256, 256), np.int32)
    image[100, 100] = 2
    image[30:200:20, 40] = 1
    assert len(run(observe(image))) == 0
    assert len(run(observe(image), MODERN)) == 0


def test_bright_sources_leave_no_rounding_noise():
    image = photon_image(np.random.default_rng(4), 0.0, [(128.0, 128.0, 3e5), (128.0, 60.0, 300.0)], 256)
    image[:, 180:] = 0
    frame = run(observe(image), PAPER_CORRECTED)
    found, distance = nearest(frame, np.array([[128.0, 128.0], [128.0, 60.0]]))
    assert distance.max() < 0.5
    # The factor is a mean over the place in the pixel, which alone scatters by 8 %.
    assert found["counts"].iloc[0] == pytest.approx(3e5, rel=0.25)
    assert not np.any(frame["x_pix"] > 200.0)


def test_crowded_and_small_and_oblong_images_are_survived():
    rng = np.random.default_rng(70)
    sources = [(*rng.uniform(0, 255, 2), c) for c in rng.uniform(20, 3000, 800)]
    crowded = photon_image(rng, BACKGROUND_10KS, sources, 256)
    assert len(run(observe(crowded))) > 100
    assert len(run(observe(crowded[:128, :200]))) > 20
    assert len(run(observe(crowded[:64, :128]), scales_pix=(1.0, 2.0, 4.0, 8.0))) > 5
    assert len(run(observe(crowded[:64, :64]), scales_pix=(2.0,))) > 2


def test_too_large_a_scale_is_refused_with_the_largest_allowed():
    with pytest.raises(ValueError, match=r"scales_pix must be at most 12\.5 \(1/8 of the image\)"):
        run(observe(np.ones((100, 300), np.int32)))
    with pytest.raises(ValueError, match="at most 8"):
        ewavelet.check_scales(PAPER, (64, 64))
    ewavelet.check_scales(PAPER, (128, 128))


@pytest.mark.parametrize("scales", [(), (0.1, 1.0), (1.0, 100.0), (2.0, 1.0), (2.0, 2.1)])
def test_scales_that_cannot_work_are_refused(scales):
    with pytest.raises(ValueError, match="scales_pix"):
        EwaveletParams(scales_pix=scales)


def test_granted_background_is_used_as_it_is():
    _, image = grid_field(81, 200.0, n_side=4, n_pix=256)
    plain = observe(image)
    granted = Observation(
        plain.counts, None, plain.exposure_s, np.full(image.shape, 0.3), plain.psf, plain.grid, plain.band
    )
    frame = run(granted, background="granted")
    np.testing.assert_allclose(frame["background_per_pix"], 0.3, rtol=1e-6)
    with pytest.raises(ValueError, match="needs an observation with a background map"):
        run(plain, background="granted")


def test_flags_say_where_a_source_is_cut():
    positions = np.array([[0.0, 128.0], [128.0, 128.0]])
    image = photon_image(np.random.default_rng(91), BACKGROUND_10KS, [(x, y, 900.0) for x, y in positions], 256)
    found, distance = nearest(run(observe(image)), positions)
    assert distance.max() < 1.5
    assert found["flags"].iloc[0] & ewavelet.FLAG_EDGE
    assert not found["flags"].iloc[1] & (ewavelet.FLAG_EDGE | ewavelet.FLAG_NOT_INTERPOLATED)


def test_reconstructed_image_keeps_the_photons():
    _, image = grid_field(95, 400.0, n_side=4, n_pix=256)
    view = DETECTOR.view(observe(image), PAPER)
    assert view.sum() == pytest.approx(image.sum(), rel=0.02)


def test_filters_of_a_shape_are_made_once():
    assert hat_ring((128, 128), (1.0, 2.0), (2.0, 2.0)) is hat_ring((128, 128), (1.0, 2.0), (2.0, 2.0))
