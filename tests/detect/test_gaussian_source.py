"""Closed forms of a Gaussian source under the Mexican hat, against sampled images and drawn photons."""

from __future__ import annotations

import math

import numpy as np
import pytest

from survey_mc.detect._ewavelet import gaussian_source as gaussian
from survey_mc.detect._shared.mexican_hat import mexican_hat

PI = math.pi


def gaussian_image(width, half=60):
    offset = np.arange(-half, half + 1)
    r2 = np.square(offset)[:, None] + np.square(offset)
    return np.exp(-0.5 * r2 / width**2) / (2.0 * PI * width**2)


@pytest.mark.parametrize("width", [2.0, 3.0, 5.0])
@pytest.mark.parametrize("sigma", [2.0, 4.0, 8.0])
def test_correlation_of_a_gaussian_source_is_the_closed_form(width, sigma):
    hat = mexican_hat(sigma)
    source = gaussian_image(width, hat.shape[0] // 2)
    measured = np.sum(hat * source) / (2.0 * PI * sigma**2)
    assert measured == pytest.approx(gaussian.peak_correlation(1.0, width, sigma), rel=0.01)
    bias = 4.0 * sigma**4 / (width**2 + sigma**2) ** 2
    assert gaussian.counts_at_scale(measured, sigma) == pytest.approx(bias, rel=0.01)


def test_counts_are_right_at_the_scale_of_the_source_which_has_the_highest_correlation():
    scales = np.geomspace(0.5, 32.0, 1201)  # holds 4
    correlation = gaussian.peak_correlation(250.0, 4.0, scales)
    best = int(np.argmax(correlation))
    assert scales[best] == pytest.approx(4.0, rel=1e-6)
    assert gaussian.counts_at_scale(correlation[best], scales[best]) == pytest.approx(250.0, rel=1e-6)


def test_two_scales_give_the_width_back():
    width = np.array([0.7, 1.0, 2.5, 6.0])
    c1, c2 = (gaussian.peak_correlation(40.0, width, sigma) for sigma in (2.0, 4.0))
    np.testing.assert_allclose(gaussian.width_from_scales(c1, 2.0, c2, 4.0), width, rtol=1e-9)


def test_no_width_where_no_gaussian_gives_the_two_correlations():
    c1 = np.array([1.0, -1.0, 100.0, 1.0])
    c2 = np.array([9.0, 1.0, 1.0, 0.0])
    assert np.all(np.isnan(gaussian.width_from_scales(c1, 2.0, c2, 4.0)))


def test_variances_are_those_of_photons():
    rng = np.random.default_rng(5)
    counts, width, background, sigma1, sigma2, trials = 60.0, 2.0, 0.5, 2.0, 4.0, 4000
    half = 20
    expected = counts * gaussian_image(width, half) + background
    fields = rng.poisson(expected, (trials, *expected.shape)).astype(np.float64)
    hats = [np.pad(mexican_hat(s), half - mexican_hat(s).shape[0] // 2) / (2 * PI * s**2) for s in (sigma1, sigma2)]
    c = np.array([np.tensordot(fields, hat, axes=2) for hat in hats])
    measured = np.cov(c)
    # A variance of 4000 values is known to 2.2 %, the covariance (ρ ≈ 0.7) to 2.8 %: 4σ.
    for k, sigma in enumerate((sigma1, sigma2)):
        assert measured[k, k] == pytest.approx(
            gaussian.correlation_variance(counts, width, background, sigma), rel=0.09
        )
    covariance = gaussian.correlation_covariance(counts, width, background, sigma1, sigma2)
    assert measured[0, 1] == pytest.approx(covariance, rel=0.115)


def test_width_and_position_errors_are_the_scatter_of_bright_gaussians():
    rng = np.random.default_rng(6)
    counts, width, background, sigma1, sigma2, trials = 3000.0, 3.0, 0.5, 4.0, 8.0, 1500
    half = 40
    fields = rng.poisson(counts * gaussian_image(width, half) + background, (trials, 2 * half + 1, 2 * half + 1))
    hats = [np.pad(mexican_hat(s), half - mexican_hat(s).shape[0] // 2) for s in (sigma1, sigma2)]
    c1, c2 = (np.tensordot(fields, h, axes=2) / (2 * PI * s**2) for h, s in zip(hats, (sigma1, sigma2), strict=True))
    widths = gaussian.width_from_scales(c1, sigma1, c2, sigma2)
    before, middle, after = (np.tensordot(fields, np.roll(hats[0], k, axis=1), axes=2) for k in (-1, 0, 1))
    places = 0.5 * (after - before) / (2.0 * middle - before - after)
    # 1500 values know their scatter to 1.8 %; the rest of the 9 % is for pixels of a third of a width.
    error = gaussian.width_error(counts, width, background, sigma1, sigma2)
    assert widths.mean() == pytest.approx(width, abs=0.03)
    assert widths.std() == pytest.approx(float(error), rel=0.09)
    assert places.std() == pytest.approx(float(gaussian.position_error(counts, width, background, sigma1)), rel=0.09)


def test_parabola_is_corrected_for_the_shape_of_the_peak():
    width, sigma = 1.0, 1.0
    place = np.linspace(-0.49, 0.49, 21)
    t = np.square(np.array([-1.0, 0.0, 1.0])[:, None] - place) / (width**2 + sigma**2)
    before, middle, after = (2.0 - t) * np.exp(-0.5 * t)
    parabola = 0.5 * (after - before) / (2.0 * middle - before - after)
    assert np.abs(parabola - place).max() > 0.03
    np.testing.assert_allclose(gaussian.peak_offset(parabola, width, sigma), place, atol=0.012)
