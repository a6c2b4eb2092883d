"""WAVDETECT: what it finds, what it measures, and what it must not find."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest
from detect_fields import BACKGROUND_10KS, BACKGROUND_100KS, EXPOSURE_S, grid_positions, observe, photon_image

from survey_mc.detect import check_detections, wavdetect
from survey_mc.detect._wavdetect.source_cells import hill_tops
from survey_mc.detect.wavdetect import DETECTOR, MODERN, PAPER, WavdetectParams, merged_sources, psf_size_pix, search

RNG = np.random.default_rng(0)
Z = 4.0  # two-sided odds of 6e-5 each
KNOWN = {"threshold": "exact", "background": "granted"}


def run(observation, params=PAPER):
    return check_detections(DETECTOR, observation, DETECTOR.detect(observation, params, RNG))


def with_background(observation, background):
    return dataclasses.replace(observation, background=np.full(observation.counts.shape, background))


def nearest(frame, positions):
    x, y = frame["x_pix"].to_numpy(), frame["y_pix"].to_numpy()
    distance = np.hypot(x[:, None] - positions[:, 0], y[:, None] - positions[:, 1])
    return frame.iloc[distance.argmin(axis=0)].reset_index(drop=True), distance.min(axis=0)


@functools.cache
def blank_counts(background, n_fields):
    """Maxima per scale, sources and sources inside 10′ of blank fields: known background, and as in the paper."""
    totals = {"known": np.zeros(11), "paper": np.zeros(11)}
    for seed in range(n_fields):
        counts = np.random.default_rng(4000 + seed).poisson(background, (512, 512))
        observation = with_background(observe(counts), background)
        for name, params in (("known", WavdetectParams(**KNOWN)), ("paper", PAPER)):
            found = search(observation, params)
            image = found.image
            sources = merged_sources(found.maxima, hill_tops(image.flux), image.flux, image.floor, 1.39)
            inside = np.hypot(sources.row - 255.5, sources.column - 255.5) < 150.0
            totals[name] += [*(len(m.row) for m in found.maxima), len(sources.row), inside.sum()]
    return totals


# Per field; measured on other fields by an independent program (5–8 fields, 10–20 %), repeated here.
BLANK_KNOWN = {
    BACKGROUND_10KS: [24.8, 22.2, 14.8, 8.8, 6.1, 2.9, 1.5, 0.8, 0.4, 50, 14],
    BACKGROUND_100KS: [23.5, 21.6, 14.1, 7.1, 4.6, 3.1, 1.6, 0.9, 0.5, 54, 15],
}


@pytest.mark.parametrize("background", BLANK_KNOWN)
def test_blank_field_has_the_noise_floor_of_its_threshold(background):
    n_fields = 6
    found = blank_counts(background, n_fields)["known"]
    for count, per_field in zip(found, BLANK_KNOWN[background], strict=True):
        expected = n_fields * per_field
        # Poisson noise of both measurements: theirs rests on about as many fields.
        assert abs(count - expected) < Z * math.sqrt(2.0 * expected) + 1.0


@pytest.mark.parametrize(("background", "per_field"), [(BACKGROUND_10KS, 34.5), (BACKGROUND_100KS, 29.9)])
def test_freeman_thresholds_and_estimated_background_leave_two_thirds_of_it(background, per_field):
    found = blank_counts(background, 6)["paper"]
    assert abs(found[9] - 6 * per_field) < Z * math.sqrt(2.0 * 6 * per_field)


@pytest.mark.parametrize("background", [BACKGROUND_10KS, BACKGROUND_100KS])
def test_modern_profile_has_a_few_false_detections_a_field(background):
    # One false pixel a scale; nine correlated scales give 3.0 ± 0.4 sources a field (12 fields): 4 fields hold < 30 and
    # > 1 with odds of 1e-4.
    counts = [
        len(run(observe(np.random.default_rng(5000 + k).poisson(background, (512, 512))), MODERN)) for k in range(4)
    ]
    assert 1 < sum(counts) < 30


@pytest.mark.parametrize("background", [BACKGROUND_10KS, BACKGROUND_100KS])
def test_background_of_a_blank_field_is_unbiased(background):
    counts = np.random.default_rng(70).poisson(background, (512, 512))
    estimate = search(observe(counts), PAPER).image.background
    # The mean of the field is known to 1/√(b·512²); cleansing removes upward noise, 0.3 % at the most.
    assert estimate.mean() == pytest.approx(counts.mean(), rel=0.003)
    assert estimate.std() / background < 0.04


def test_background_follows_the_vignetting():
    y, x = np.mgrid[:512, :512]
    share = np.clip(1.0 - (np.hypot(x - 255.5, y - 255.5) / 300.0) ** 2, 0.0, None)
    share[share < 0.2] = 0.0
    expected = BACKGROUND_100KS * share
    counts = np.random.default_rng(71).poisson(expected)
    estimate = search(observe(counts, share * EXPOSURE_S), PAPER).image.background
    ratio = estimate[share > 0] / expected[share > 0]
    assert ratio.mean() == pytest.approx(1.0, abs=0.006)
    assert ratio.std() < 0.04


def test_background_under_sources_is_theirs_only_by_their_wings():
    # 64 sources of 300 counts are 0.07 a pixel, 41 % of the sky; cleansing leaves a fifth of that in the map.
    positions = grid_positions(8, 512, np.random.default_rng(72))
    counts = photon_image(np.random.default_rng(73), BACKGROUND_10KS, [(x, y, 300.0) for x, y in positions])
    excess = search(observe(counts), PAPER).image.background.mean() / BACKGROUND_10KS - 1.0
    assert 0.0 < excess < 0.15


def sources_found(counts, background, params=PAPER, seed=80, core_arcsec=None, n_side=8):
    """Matched rows and their positions for a grid of equal sources."""
    positions = grid_positions(n_side, 512, np.random.default_rng(seed))
    image = photon_image(
        np.random.default_rng(seed + 1), background, [(x, y, counts) for x, y in positions], 512, core_arcsec
    )
    found, distance = nearest(run(observe(image), params), positions)
    return found[distance < 6.0], positions[distance < 6.0]


# Mean ratio and standard deviation of one source over 128 sources of other fields.
@pytest.mark.parametrize(
    ("counts", "ratio", "scatter"), [(30.0, 0.78, 0.21), (100.0, 0.80, 0.11), (300.0, 0.81, 0.056)]
)
def test_cell_holds_four_fifths_of_a_point_source(counts, ratio, scatter):
    found, _ = sources_found(counts, BACKGROUND_10KS)
    assert len(found) >= 62
    assert found["counts"].mean() / counts == pytest.approx(ratio, abs=Z * scatter * math.sqrt(1 / 64 + 1 / 128))


@pytest.mark.parametrize(("counts", "core_arcsec"), [(1316.0, 32.9), (465.0, 29.4), (200.0, 29.2)])
def test_cell_of_the_psfs_size_loses_nine_tenths_of_a_cluster(counts, core_arcsec):
    # 0.10 ± 0.05 a cluster (96 clusters of other fields); means of 16 differ from it by 0.055 with odds of 1e-4.
    found, _ = sources_found(counts, BACKGROUND_10KS, core_arcsec=core_arcsec, n_side=4)
    assert found["counts"].mean() / counts == pytest.approx(0.10, abs=0.055)


def test_cell_of_twice_the_psfs_size_loses_three_quarters_of_a_bright_cluster():
    # 0.25 ± 0.106 a cluster (96 clusters of other fields).
    wide = WavdetectParams(flux_scales_pix=(2.0,))
    found, _ = sources_found(1316.0, BACKGROUND_10KS, wide, core_arcsec=32.9, n_side=4)
    assert found["counts"].mean() / 1316.0 == pytest.approx(0.25, abs=Z * 0.106 * math.sqrt(1 / 16 + 1 / 96))


def test_aperture_correction_restores_the_counts_of_point_sources():
    found, _ = sources_found(1000.0, BACKGROUND_10KS, WavdetectParams(aperture_correction="psf_cell"))
    # 3.5 % scatter of one source; the correction is good to 1 %.
    assert found["counts"].mean() == pytest.approx(1000.0, rel=Z * 0.035 / 8.0 + 0.01)
    assert found["psf_fraction"].between(0.7, 0.95).all()


@pytest.mark.parametrize("background", [BACKGROUND_10KS, BACKGROUND_100KS])
def test_position_errors_are_the_scatter_of_the_positions(background):
    found, positions = sources_found(120.0, background)
    pulls = (found[["x_pix", "y_pix"]].to_numpy() - positions) / found[["x_err_pix", "y_err_pix"]].to_numpy()
    # 0.86 and 0.83 (384 pulls); 128 pulls know their rms to 6 %.
    assert 0.65 < np.sqrt(np.square(pulls).mean()) < 1.05


def test_half_of_the_faintest_sources_are_found():
    # Sources of 12.5 counts at 10 ks are found with 0.53 (192 sources), matched within 6 pixels; binomial 4σ of 64.
    found, _ = sources_found(12.5, BACKGROUND_10KS)
    assert 0.28 < len(found) / 64 < 0.80


def test_psf_size_and_flux_scale_are_those_of_the_paper():
    psf = observe(np.ones((8, 8), int)).psf
    assert psf_size_pix(psf, 0.393, 4.0) == pytest.approx(1.39, abs=0.005)
    assert PAPER.scales_pix[wavdetect.flux_scale(PAPER, 1.39)] == pytest.approx(math.sqrt(2.0))
    assert wavdetect.flux_scale(WavdetectParams(flux_scales_pix=(8.0, 16.0)), 1.39) == 6


def test_mask_edges_and_gaps_make_no_false_detections():
    y, x = np.mgrid[:512, :512]
    exposure = np.full((512, 512), EXPOSURE_S)
    exposure[np.hypot(x - 255.5, y - 255.5) > 225] = 0.0
    exposure[150:153] = 0.0
    exposure[:, 300:340] = 0.0
    whole, masked = 0, 0
    for seed in range(4):
        counts = np.random.default_rng(600 + seed).poisson(BACKGROUND_100KS, (512, 512))
        whole += len(run(observe(counts)))
        frame = run(observe(np.where(exposure > 0, counts, 0), exposure))
        masked += len(frame)
        assert np.all(exposure[np.rint(frame["y_pix"]).astype(int), np.rint(frame["x_pix"]).astype(int)] > 0)
    expected = whole * (exposure > 0).mean()
    assert abs(masked - expected) < Z * math.sqrt(2.0 * expected)


def test_steps_of_the_exposure_make_no_false_detections():
    exposure = np.full((512, 512), EXPOSURE_S)
    exposure[:, 200:204] *= 0.3
    exposure[100:130] *= 0.12
    exposure[300:, 300:] *= 0.5
    total = 0
    for seed in range(4):
        counts = np.random.default_rng(650 + seed).poisson(BACKGROUND_100KS * exposure / EXPOSURE_S)
        total += len(run(observe(counts, exposure)))
    assert abs(total - 4 * 31.0) < Z * math.sqrt(2.0 * 4 * 31.0)


def test_nothing_is_detected_where_the_exposure_is_short():
    exposure = np.full((256, 256), EXPOSURE_S)
    exposure[:, :100] *= 0.05
    image = photon_image(np.random.default_rng(6), BACKGROUND_10KS, [(40.0, 128.0, 300.0), (200.0, 128.0, 300.0)], 256)
    assert run(observe(image, exposure))["x_pix"].min() > 90.0
    everywhere = run(observe(image, exposure), WavdetectParams(exp_thresh=0.0))
    assert nearest(everywhere, np.array([[40.0, 128.0]]))[1][0] < 1.0


def test_single_precision_makes_no_sources_beside_a_very_bright_one():
    sources = [(128.0, 128.0, 3e5)]
    image = photon_image(np.random.default_rng(4), BACKGROUND_10KS, sources, 256)
    image[np.hypot(*(np.indices(image.shape) - 128.0)) > 60.0] = 0
    image[250:, :] = 0
    frame = run(observe(image))
    assert abs(frame["x_pix"].iloc[0] - 128.0) < 0.1
    assert frame["counts"].iloc[0] > 2.4e5
    # Nothing but empty sky beyond 62 pixels: a detection there would be rounding.
    assert np.all(np.hypot(frame["x_pix"] - 128.0, frame["y_pix"] - 128.0) < 62.0)


@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (64, 64), (64, 200), (128, 40)])
def test_images_smaller_than_the_wavelet_are_searched(shape):
    counts = np.random.default_rng(7).poisson(0.2, shape)
    counts[shape[0] // 2, shape[1] // 2] += 40 if min(shape) > 5 else 0
    frame = run(observe(counts))
    if min(shape) > 5:
        assert nearest(frame, np.array([[shape[1] // 2, shape[0] // 2]]))[1][0] < 0.5


@pytest.mark.parametrize("photons", [0, 1, 2])
def test_two_photons_are_no_source(photons):
    counts = np.zeros((128, 128), int)
    counts[60, 50] = photons
    assert len(run(observe(counts))) == 0
    assert len(run(observe(counts), MODERN)) == 0


@pytest.mark.parametrize("params", [PAPER, MODERN], ids=["paper", "modern"])
def test_crowded_field_is_survived(params):
    rng = np.random.default_rng(70)
    sources = [(*rng.uniform(0, 255, 2), c) for c in rng.uniform(20, 3000, 800)]
    assert len(run(observe(photon_image(rng, BACKGROUND_10KS, sources, 256)), params)) > 300


def test_turned_image_gives_turned_sources():
    image = photon_image(np.random.default_rng(21), BACKGROUND_10KS, [(60, 70, 200.0), (150, 90, 80.0)], 200)[:, :180]
    frame, turned = run(observe(image)), run(observe(np.rot90(image).copy()))
    found, distance = nearest(turned, np.stack([frame["y_pix"], 179 - frame["x_pix"]], axis=1))
    assert len(turned) == len(frame)
    assert distance.max() < 1e-3
    np.testing.assert_allclose(found["counts"], frame["counts"], rtol=1e-4)


def test_extreme_parameters_are_survived():
    image = photon_image(np.random.default_rng(22), BACKGROUND_10KS, [(60, 70, 200.0)], 128)
    for changes in (
        {"scales_pix": [0.5]},
        {"scales_pix": [64.0]},
        {"scales_pix": [3.0, 40.0, 64.0], "background_min_scale_pix": 64.0},
        {"background_min_scale_pix": 0.0, "max_iter": 20, "iter_stop": 0.0, "bkg_sig_thresh": 0.05},
        {"max_iter": 0, "sigthresh": 1e-9, "threshold": "exact"},
        {"sigthresh": 0.01, "photons_min": 1.0, "threshold": "exact"},
        {"false_per_scale": 1e6, "psf_ecf": 0.95},
        {"false_per_scale": 1e-6, "psf_ecf": 0.01, "aperture_correction": "psf_cell"},
        {"exp_thresh": 0.99, "centroid": "photons", "ell_sigma": 100.0},
    ):
        frame = run(observe(image), WavdetectParams(**changes))
        assert np.isfinite(frame["significance"]).all()


def test_granted_background_is_used():
    image = photon_image(np.random.default_rng(23), BACKGROUND_10KS, [(60, 70, 200.0)], 128)
    granted = with_background(observe(image), BACKGROUND_10KS)
    frame = run(granted, WavdetectParams(background="granted"))
    np.testing.assert_allclose(frame["background_per_pix"], BACKGROUND_10KS, rtol=1e-5)
    np.testing.assert_allclose(frame["BKG_COUNTS_ERR"], 0.0)
    with pytest.raises(ValueError, match="needs an observation with a background map"):
        run(observe(image), WavdetectParams(background="granted"))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"scales_pix": [2.0, 1.0]}, "scales_pix must ascend"),
        ({"scales_pix": [0.1, 1.0]}, "scales_pix must be 0.5"),
        ({"flux_scales_pix": [3.0]}, "flux_scales_pix must be among scales_pix"),
        ({"sigthresh": 0.5}, "sigthresh"),
        ({"background": "guess"}, "background"),
    ],
)
def test_parameters_outside_their_domain_are_refused(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        WavdetectParams(**changes)
