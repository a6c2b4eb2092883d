"""The stellarity index: isophotal areas, inputs, seeing, and what the shipped network says."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from detect_fields import BACKGROUND_10KS, TestPsf, grid_positions, observe, photon_image
from pydantic import ValidationError

from survey_mc.detect import DETECTORS, with_native_names
from survey_mc.detect._sextractor.isophotes import N_LEVELS, isophotal_areas
from survey_mc.detect._sextractor.seeing import smoothed_fwhm_arcsec
from survey_mc.detect._sextractor.sep_chain import SepParams, extract
from survey_mc.detect._sextractor.stellarity import SHIPPED_NETWORKS, network_inputs, open_network, stellarity
from survey_mc.detect._shared.smoothing import sigma_pix_from_fwhm, smooth
from survey_mc.errors import BadInput
from survey_mc.telescope.psf import KingPsf

SEP_METHODS = [("gauss_se", "paper"), ("gauss_se", "paper_clusters"), ("mr1_se", "paper")]
# Answers sigmoid(1), whatever the inputs: all weights are 0 and the last bias is 1.
CONSTANT = "NNW\n3 10 1 1\n" + "0 " * 10 + "1 " * 10 + "0 " * 11 + "0 1 " + "0 1\n"


def areas_by_counting(segments, signal, peaks, thresholds) -> np.ndarray:
    """The definition, one object and one level after the other."""
    found = []
    for i, (peak, threshold) in enumerate(zip(peaks, thresholds, strict=True)):
        own = signal[segments == i + 1].astype(float)
        found.append([(own > threshold * (peak / threshold) ** (k / 8)).sum() for k in range(8)])
    return np.array(found)


def test_isophotal_areas_are_the_numbers_of_brighter_pixels_of_the_object() -> None:
    rng = np.random.default_rng(3)
    places = rng.uniform(5.0, 250.0, (120, 2))
    image = photon_image(rng, 0.2, [(x, y, 80.0) for x, y in places], 256)
    signal = (smooth(image.astype(float), 1.3) - 0.2).astype(np.float32)
    threshold = np.full(signal.shape, 0.3, np.float32)
    found = extract(signal, threshold, np.zeros(signal.shape, bool), SepParams())
    objects = found.objects
    box = np.stack([objects[n] for n in ("xmin", "xmax", "ymin", "ymax")], axis=1).astype(np.int64)
    segments, level = np.ascontiguousarray(found.segments, np.int32), np.full(len(objects), float(threshold[0, 0]))
    peak = objects["peak"].astype(float)

    areas = isophotal_areas(segments, box, signal, peak, level)

    assert len(objects) > 60
    assert (objects["flag"] & 1).any()  # some are blended
    np.testing.assert_array_equal(areas, areas_by_counting(segments, signal, peak, level))


@pytest.mark.parametrize(("name", "profile"), SEP_METHODS)
def test_areas_of_a_detection_fall_from_its_isophote_to_its_peak(name: str, profile: str) -> None:
    frame = with_native_names(DETECTORS[name], detections(name, profile, seed=1, counts=200.0))

    areas = frame[[f"ISO{k}" for k in range(N_LEVELS)]].to_numpy()
    assert (np.diff(areas, axis=1) <= 0).all()
    assert (areas[:, 0] <= frame["ISOAREA_IMAGE"]).all()
    assert (areas[:, -1] >= 1).all()  # the peak is above the last level
    assert frame["CLASS_STAR"].between(0.0, 1.0).all()


def test_inputs_are_logarithms_in_units_of_the_seeing_disc() -> None:
    areas = np.array([[64, 32, 16, 8, 4, 2, 1, 0]])

    inputs = network_inputs(areas, np.array([100.0]), seeing_arcsec=10.0, scale_arcsec=2.5)

    # f = 4 pixels: 64 pixels are 4 seeing discs, and no pixel counts as 0.01 of one
    by_hand = [math.log10(4.0), 2.0, *(math.log10(2.0 / 2**k) for k in range(6)), -2.0, 1.0]
    np.testing.assert_allclose(inputs, [by_hand], rtol=1e-14)


def test_index_of_an_object_does_not_depend_on_the_others() -> None:
    rng = np.random.default_rng(8)
    areas = -np.sort(-rng.integers(0, 200, (50, 8)), axis=1)
    ratio = rng.uniform(1.1, 90.0, 50)
    network = open_network("xmm_epic")

    together = stellarity(areas, ratio, 15.0, 4.0, network)
    alone = [stellarity(areas[i : i + 1], ratio[i : i + 1], 15.0, 4.0, network)[0] for i in range(50)]

    assert together.tolist() == alone


def test_seeing_of_a_gaussian_psf_is_the_sum_in_quadrature() -> None:
    psf = KingPsf.from_fwhm_hew(6.0, 6.006)  # almost a Gaussian
    for sigma_pix in (0.0, 1.0, sigma_pix_from_fwhm(20.0, 4.0)):
        filter_variance = (sigma_pix**2 + 1.0 / 12.0) * 4.0**2 * 8.0 * math.log(2.0)
        assert smoothed_fwhm_arcsec(psf, sigma_pix, 4.0) == pytest.approx(math.sqrt(36.0 + filter_variance), rel=2e-3)


@pytest.mark.parametrize(("name", "profile"), SEP_METHODS)
def test_seeing_is_the_width_of_a_point_in_the_filtered_image(name: str, profile: str) -> None:
    params = DETECTORS[name].profiles[profile]
    bright = [(60.3, 64.1, 2e5), (190.8, 64.6, 2e5), (60.5, 190.0, 2e5), (190.2, 190.7, 2e5)]
    image = DETECTORS[name].view(observe(photon_image(np.random.default_rng(2), 0.1, bright, 256)), params)

    half_area = sum(
        (image[int(y) - 20 : int(y) + 21, int(x) - 20 : int(x) + 21] > 0.5 * image[round(y), round(x)]).sum()
        for x, y, _ in bright
    )

    measured_arcsec = 4.0 * math.sqrt(half_area / 4.0 * 4.0 / math.pi)
    assert params.seeing(TestPsf(), 4.0) == pytest.approx(measured_arcsec, rel=0.12)  # a few pixels in half_area


def test_a_given_seeing_is_taken() -> None:
    assert DETECTORS["gauss_se"].params(seeing_arcsec=7.5).seeing(TestPsf(), 4.0) == 7.5


def test_a_file_of_the_user_is_the_network(tmp_path: Path) -> None:
    (tmp_path / "own.nnw").write_text(CONSTANT)

    frame = detections("gauss_se", "paper", 4, 200.0, stellarity_network=str(tmp_path / "own.nnw"))

    assert len(frame)
    np.testing.assert_allclose(frame["stellarity"], 1.0 / (1.0 + math.exp(-1.0)), rtol=1e-14)


def test_a_name_that_is_neither_shipped_nor_a_file_is_refused() -> None:
    with pytest.raises(ValidationError, match=r"must be xmm_epic, or the path of a file that ends in \.nnw"):
        DETECTORS["mr1_se"].params(stellarity_network="xmm_epik")


def test_a_network_that_cannot_classify_is_refused_before_anything_is_done(tmp_path: Path) -> None:
    path = tmp_path / "two.nnw"
    path.write_text("NNW\n2 2 1\n0 0 1 1\n0 0 0\n0 1\n")
    for name in ("gauss_se", "mr1_se"):
        params = DETECTORS[name].params(stellarity_network=str(path))
        with pytest.raises(BadInput, match=r"must be a network of 10 inputs and 1 output \(got 2 and 1\)"):
            DETECTORS[name].check(params, (512, 512))


def detections(name: str, profile: str, seed: int, counts: float, core_arcsec: float | None = None, **changes: object):
    """What a procedure finds on a field of 25 equal sources."""
    rng = np.random.default_rng(seed)
    places = [(x, y, counts) for x, y in grid_positions(5, 256, rng)]
    observation = observe(photon_image(rng, BACKGROUND_10KS, places, 256, core_arcsec))
    params = DETECTORS[name].params(**{**DETECTORS[name].profiles[profile].model_dump(), **changes})
    frame = DETECTORS[name].detect(observation, params, rng)
    offset = np.hypot(*(np.array(places)[:, :2].T[:, :, None] - frame[["x_pix", "y_pix"]].to_numpy().T[:, None, :]))
    return frame[frame["isoarea_pix"] > 0].iloc[np.flatnonzero(offset.min(axis=0) < 2.5)]


@pytest.mark.parametrize(("name", "profile"), SEP_METHODS)
def test_points_and_clusters_of_300_counts_are_told_apart(name: str, profile: str) -> None:
    points = detections(name, profile, 5, 300.0)["stellarity"].to_numpy()
    clusters = detections(name, profile, 6, 300.0, core_arcsec=25.0)["stellarity"].to_numpy()

    assert len(points) >= 24
    assert len(clusters) >= 15
    # In 20 other fields none of 500 points was below ½, and at most 4 of 445 clusters above (12″; else none of 496).
    # With the upper limits (95 %) 0.6 % and 2.1 % more wrong ones of 25 than allowed have odds below 5e-4 each.
    assert (points < 0.5).sum() <= 2
    assert (clusters > 0.5).sum() <= 4
    assert np.median(points) > 0.9
    assert np.median(clusters) < 0.1


def test_every_shipped_network_is_listed() -> None:
    import survey_mc.detect._sextractor.stellarity as module

    files = {path.stem for path in (Path(module.__file__).parent / "networks").glob("*.nnw")}
    assert files == set(SHIPPED_NETWORKS)
