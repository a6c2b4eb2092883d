"""Numbers at the ends of what is allowed: an answer, or a sentence that says what is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from detect_fields import EXPOSURE_S, TestPsf, observe, photon_image
from pydantic import ValidationError

from survey_mc.detect import DETECTORS, check_detections
from survey_mc.detect._vtp import photon_cells

SOURCES = [(30.0, 40.0, 300.0), (70.0, 60.0, 100.0)]


def run(name, observation, profile="paper", **changes):
    detector = DETECTORS[name]
    params = detector.params(**{**detector.profiles[profile].model_dump(), **changes})
    return check_detections(detector, observation, detector.detect(observation, params, np.random.default_rng(0)))


@pytest.fixture(scope="module")
def image():
    return photon_image(np.random.default_rng(3), 0.178, SOURCES, 128)


@pytest.mark.parametrize("name", ["vtpdetect", "wavdetect", "ewavelet", "gauss_se", "mr1_se"])
def test_exposure_too_short_for_a_rate_is_refused(name, image):
    exposure_s = np.full(image.shape, EXPOSURE_S)
    exposure_s[:20] = 1e-320
    with pytest.raises(ValueError, match="exposure_s must be 0 or at least 1e-100 s"):
        run(name, observe(image, exposure_s), "paper", **({"scales_pix": (1.0, 2.0)} if name == "ewavelet" else {}))


def test_exposures_of_all_sizes_have_position_errors(image):
    exposure_s = np.full(image.shape, EXPOSURE_S)
    exposure_s[:20] = 1e-90
    frame = run("gauss_se", observe(image, exposure_s), divide_by_exposure=True)
    assert len(frame)
    assert np.isfinite(frame[["x_err_pix", "y_err_pix"]]).all(axis=None)


@pytest.mark.parametrize("positions", ["jitter", "photons"])
def test_more_photons_than_can_have_cells_are_refused(positions, image, monkeypatch):
    monkeypatch.setattr(photon_cells, "MOST_PHOTONS", int(image.sum()) - 1)
    observation = replace(observe(image), photons_pix=np.argwhere(np.ones(int(image.sum()))[:, None]) * 0.001)
    with pytest.raises(ValueError, match=f'positions = "{positions}" takes at most {image.sum() - 1} photons'):
        run("vtpdetect", observation, positions=positions)
    assert len(run("vtpdetect", observation, positions="pixel"))


def test_ewavelet_leaves_counts_alone_where_the_psf_fills_the_ring(image):
    wide = replace(observe(image), psf=TestPsf(core_radius_arcsec=3000.0))
    scales_pix = (1.0, 2.0)
    plain = run("ewavelet", wide, scales_pix=scales_pix)
    corrected = run("ewavelet", wide, scales_pix=scales_pix, counts_correction="psf_table")
    assert len(plain)
    np.testing.assert_array_equal(corrected["counts"], plain["counts"])
    assert (corrected["flags"] & 16).all()
    assert not (plain["flags"] & 16).any()


def test_gaussian_of_too_many_pixels_is_refused_with_the_largest_allowed(image):
    observation = observe(image)
    fine = replace(observation, grid=replace(observation.grid, scale_arcsec=0.5))
    with pytest.raises(ValueError, match=r"fwhm_arcsec must be at most 150\.708 for pixels of 0.5″"):
        run("gauss_se", fine, fwhm_arcsec=600.0)


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("gauss_se", "fwhm_arcsec", 1e-300),
        ("gauss_se", "photons_min", 1e300),
        ("mr1_se", "threshold_sqrt_background", 1e-300),
        ("mr1_se", "threshold_sqrt_background", 1e300),
        ("mr1_se", "threshold_min_per_pix", 1e300),
        ("mr1_se", "kron_factor", 1e-300),
        ("vtpdetect", "limit", 0.0),
    ],
)
def test_numbers_out_of_proportion_are_refused(name, key, value):
    with pytest.raises(ValidationError, match=key):
        DETECTORS[name].params(**{key: value})


@pytest.mark.parametrize("measure_on", ["raw", "filtered"])
def test_smallest_aperture_is_corrected_by_a_number(measure_on, image):
    frame = run(
        "gauss_se",
        replace(observe(image), psf=TestPsf(core_radius_arcsec=1e9)),
        kron_factor=0.1,
        kron_radius_min=0.1,
        aperture_correction="psf_table",
        measure_on=measure_on,
    )
    assert len(frame)
    assert np.isfinite(frame["counts"]).all()
