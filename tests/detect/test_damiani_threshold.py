"""The closed-form threshold of the Mexican hat against the exact one, and its inverse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from survey_mc.detect._ewavelet.damiani_threshold import damiani_threshold, equivalent_sigma, exact_threshold

ONE_IN_10000_SIGMA = 3.719
SCALES_PIX = (1.0, 2.0, 4.0, 8.0, 16.0)
# b per pixel: threshold of W⋆D at 3.719σ by the formula, and the exact 1e-4 threshold, at each scale.
FORMULA = {0.178: (6.36, 10.30, 18.16, 33.89, 65.36), 1.78: (14.87, 27.30, 52.18, 101.9, 201.4)}
EXACT = {0.178: (6.59, 10.29, 18.22, 33.99, 65.5), 1.78: (15.37, 27.39, 52.30, 102.1, 201.9)}


@pytest.mark.parametrize("background", FORMULA)
def test_formula_and_exact_threshold_have_the_tabulated_values(background):
    b = np.array([background])
    formula = [damiani_threshold(b, sigma, ONE_IN_10000_SIGMA)[0] for sigma in SCALES_PIX]
    exact = [exact_threshold(b, sigma, 1e-4)[0] for sigma in SCALES_PIX]
    np.testing.assert_allclose(formula, FORMULA[background], rtol=1e-3)
    np.testing.assert_allclose(exact, EXACT[background], rtol=3e-3)


@pytest.mark.parametrize(("k_sigma", "expected"), [(4.0, (19.76, 56.34))])
def test_four_sigma_is_higher_than_one_in_ten_thousand(k_sigma, expected):
    np.testing.assert_allclose(damiani_threshold(np.array([0.178, 1.78]), 4.0, k_sigma), expected, rtol=1e-3)


def test_formula_is_the_exact_threshold_within_one_percent_for_scales_above_two():
    for sigma in (2.0, 2.828, 4.0, 8.0):
        q = np.array([4.0, 10.0, 30.0, 100.0, 400.0])
        background = q / (2.0 * math.pi * sigma**2)
        formula = damiani_threshold(background, sigma, ONE_IN_10000_SIGMA)
        np.testing.assert_allclose(formula, exact_threshold(background, sigma, 1e-4), rtol=0.01)


def test_formula_is_three_percent_low_at_one_pixel():
    b = np.array([0.178, 1.78])
    ratio = damiani_threshold(b, 1.0, ONE_IN_10000_SIGMA) / exact_threshold(b, 1.0, 1e-4)
    assert np.all((ratio > 0.96) & (ratio < 0.975))


def test_equivalent_sigma_is_the_inverse_of_the_threshold():
    background = np.array([1e-6, 0.01, 0.178, 1.78, 100.0])
    for k_sigma in (1.5, 3.72, 5.0, 40.0):
        correlation = damiani_threshold(background, 2.0, k_sigma)
        np.testing.assert_allclose(equivalent_sigma(correlation, background, 2.0), k_sigma, rtol=1e-9)


def test_thresholds_of_no_pixel_are_no_thresholds():
    assert exact_threshold(np.zeros(0), 2.0, 1e-4).size == 0


def test_exact_threshold_grows_with_background_scale_and_rarity():
    background = np.geomspace(0.03, 100.0, 30)
    assert np.all(np.diff(exact_threshold(background, 2.0, 1e-5)) > 0.0)
    at = np.array([0.3])
    assert exact_threshold(at, 2.0, 1e-6)[0] > exact_threshold(at, 2.0, 1e-4)[0]
    assert exact_threshold(at, 4.0, 1e-4)[0] > exact_threshold(at, 2.0, 1e-4)[0]
