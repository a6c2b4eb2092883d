"""The mixed procedures, G+SE and MR/1+SE: what SExtractor's chain adds to what every procedure must show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from detect_fields import EXPOSURE_S, FLUX_PER_RATE_CGS, grid_positions, observe, photon_image

from survey_mc.detect import DETECTORS, check_detections
from survey_mc.detect.gauss_se import GaussSeParams
from survey_mc.detect.mr1_se import Mr1SeParams

MIXED = ("gauss_se", "mr1_se")
both_procedures = pytest.mark.parametrize("detector", [DETECTORS[name] for name in MIXED], ids=MIXED)


def run(detector, observation, **changes):
    params = detector.params(**changes)
    frame = detector.detect(observation, params, np.random.default_rng(0))
    return check_detections(detector, observation, frame)


def bright_sources(seed=21, n_pix=256, counts=400.0):
    positions = grid_positions(4, n_pix, np.random.default_rng(seed))
    image = photon_image(np.random.default_rng(seed + 1), 0.178, [(x, y, counts) for x, y in positions], n_pix)
    return positions, image


def nearest(frame, positions):
    distance = np.hypot(
        frame["x_pix"].to_numpy()[:, None] - positions[:, 0], frame["y_pix"].to_numpy()[:, None] - positions[:, 1]
    )
    return frame.iloc[distance.argmin(axis=0)], distance.min(axis=0)


@both_procedures
def test_position_errors_are_the_scatter_of_the_positions(detector):
    positions = grid_positions(8, 512, np.random.default_rng(50))
    image = photon_image(np.random.default_rng(51), 0.178, [(x, y, 120.0) for x, y in positions])
    found, distance = nearest(run(detector, observe(image)), positions)
    close = distance < 1.5
    assert close.sum() >= 60
    offset = found[["x_pix", "y_pix"]].to_numpy() - positions
    pulls = (offset / found[["x_err_pix", "y_err_pix"]].to_numpy())[close]
    # The errors are 20 % too long (six fields: 0.83 ± 0.02); 128 pulls know their rms to 6 %, the bounds are at 2.5σ.
    assert 0.70 < np.sqrt(np.square(pulls).mean()) < 0.96


@both_procedures
def test_rate_and_flux_follow_from_counts_and_the_exposure_of_the_pixel(detector):
    exposure = np.full((256, 256), EXPOSURE_S)
    exposure[:, 128:] *= 0.5
    frame = run(detector, observe(bright_sources()[1], exposure))
    at = exposure[np.rint(frame["y_pix"]).astype(int), np.rint(frame["x_pix"]).astype(int)]
    np.testing.assert_allclose(frame["exposure_s"], at)
    np.testing.assert_allclose(frame["rate_cps"], frame["counts"] / at)
    np.testing.assert_allclose(frame["flux_cgs"], frame["rate_cps"] * FLUX_PER_RATE_CGS)


@both_procedures
def test_very_bright_source_is_measured_and_its_neighbours_at_the_edge_are_found(detector):
    sources = [(128.0, 128.0, 3e5), (0.0, 60.0, 300.0), (255.0, 255.0, 300.0), (60.0, 255.0, 300.0)]
    image = photon_image(np.random.default_rng(4), 0.178, sources, 256)
    frame = run(detector, observe(image))
    found, distance = nearest(frame, np.array([s[:2] for s in sources]))
    assert distance[0] < 0.1
    assert found["counts"].iloc[0] > 2e5
    assert distance[1:].max() < 3.0


@both_procedures
def test_masked_blank_field_has_few_false_detections(detector):
    rng = np.random.default_rng(60)
    exposure = np.full((512, 512), EXPOSURE_S)
    y, x = np.mgrid[:512, :512]
    exposure[np.hypot(x - 255.5, y - 255.5) > 225] = 0.0
    exposure[150:153, :] = 0.0
    exposure[:, 300:340] = 0.0
    image = np.where(exposure > 0, rng.poisson(1.78, (512, 512)), 0)
    frame = run(detector, observe(image, exposure))
    # A blank field of this area has ~4 false detections at 100 ks in the worse procedure; P(> 12) < 1e-3.
    assert len(frame) <= 12


@both_procedures
def test_source_cut_by_a_mask_keeps_its_place_and_half_of_its_counts(detector):
    exposure = np.full((256, 256), EXPOSURE_S)
    exposure[:, 131:] = 0.0
    image = np.where(exposure > 0, photon_image(np.random.default_rng(5), 0.178, [(128.0, 128.0, 300.0)], 256), 0)
    found, distance = nearest(run(detector, observe(image, exposure)), np.array([[128.0, 128.0]]))
    assert distance[0] < 1.5
    assert found["counts"].iloc[0] > 100.0


@both_procedures
def test_crowded_field_at_zero_contrast_is_survived_and_flagged(detector):
    rng = np.random.default_rng(70)
    sources = [(*rng.uniform(0, 255, 2), c) for c in rng.uniform(20, 3000, 800)]
    frame = run(detector, observe(photon_image(rng, 0.178, sources, 256)))
    assert len(frame) > 100
    assert (frame["flags"] != 0).any()


@both_procedures
def test_view_is_the_searched_image(detector):
    observation = observe(bright_sources()[1])
    image = detector.view(observation, detector.params())
    assert image.shape == (256, 256)
    assert image.dtype == np.float64
    assert image.sum() == pytest.approx(observation.counts.sum(), rel=0.02)


@both_procedures
def test_raw_and_filtered_photometry_agree(detector):
    positions, image = bright_sources(counts=1500.0)
    observation = observe(image)
    filtered, _ = nearest(run(detector, observation), positions)
    raw, _ = nearest(run(detector, observation, measure_on="raw"), positions)
    np.testing.assert_allclose(raw["counts"].mean(), filtered["counts"].mean(), rtol=0.05)


@both_procedures
@pytest.mark.parametrize(
    "changes", [{"clean": False}, {"deblend_contrast": 1.0}, {"neighbours": "blank"}, {"mesh_pix": 1000}]
)
def test_options_of_the_extraction_work(detector, changes):
    positions, image = bright_sources()
    _, distance = nearest(run(detector, observe(image), **changes), positions)
    assert distance.max() < 1.0


@pytest.mark.parametrize(
    "changes",
    [
        {"rms": "analytic"},
        {"rms": "sep_local"},
        {"threshold_kind": "poisson_exact"},
        {"background": "clipped_mean"},
        {"divide_by_exposure": True},
        {"divide_by_exposure": True, "measure_on": "raw", "background": "clipped_mean", "rms": "analytic"},
    ],
)
def test_options_of_gauss_se_work_under_vignetting(changes):
    y, x = np.mgrid[:256, :256]
    share = np.clip(1.0 - (np.hypot(x - 127.5, y - 127.5) / 200.0) ** 2, 0.0, None)
    share[share < 0.3] = 0.0
    positions, image = bright_sources(counts=1500.0)
    thinned = np.random.default_rng(9).binomial(image, share)
    frame = run(DETECTORS["gauss_se"], observe(thinned, share * EXPOSURE_S), **changes)
    found, distance = nearest(frame, positions)
    there = share[np.rint(positions[:, 1]).astype(int), np.rint(positions[:, 0]).astype(int)]
    deep = there > 0.5
    assert distance[deep].max() < 1.0
    # Kron apertures hold 0.75 to 0.95 of a point source; counts are as they fell, rates are as on axis.
    assert 0.75 < (found["counts"].to_numpy()[deep] / (1500.0 * there[deep])).mean() < 0.97
    assert 0.75 < (found["rate_cps"].to_numpy()[deep] * EXPOSURE_S / 1500.0).mean() < 0.97


def test_higher_threshold_keeps_a_subset_ranked_by_significance():
    observation = observe(bright_sources()[1])
    low = run(DETECTORS["gauss_se"], observation, threshold_sigma=4.0, deblend_contrast=1.0, minarea_pix=1)
    high = run(DETECTORS["gauss_se"], observation, threshold_sigma=8.0, deblend_contrast=1.0, minarea_pix=1)
    assert len(high) == (low["significance"] >= 8.0).sum()


def test_too_many_scales_for_the_image_is_a_sentence():
    with pytest.raises(ValueError, match=r"n_scales must be 2\.\.6 for a 128-pixel image"):
        run(DETECTORS["mr1_se"], observe(np.ones((128, 128), np.int32)), n_scales=9)


def test_parameters_outside_their_domain_are_refused():
    for model, changes in (
        (GaussSeParams, {"fwhm_arcsec": -1.0}),
        (GaussSeParams, {"rms": "guess"}),
        (Mr1SeParams, {"significance": 0.5}),
        (Mr1SeParams, {"minarea": 3}),
    ):
        with pytest.raises(ValueError, match=next(iter(changes))):
            model(**changes)


@both_procedures
def test_granted_background_is_the_one_of_every_detection(detector):
    observation = replace(observe(bright_sources()[1]), background=np.full((256, 256), 0.178))
    frame = run(detector, observation, background="granted")
    np.testing.assert_allclose(frame["background_per_pix"], 0.178, rtol=1e-5)
