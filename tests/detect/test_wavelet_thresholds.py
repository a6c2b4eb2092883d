"""Thresholds of the Mexican hat: Freeman's fit and the exact Poisson distribution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from detect_fields import BACKGROUND_10KS, BACKGROUND_100KS, TestPsf

from survey_mc.detect._shared.exact_threshold import filter_threshold
from survey_mc.detect._shared.mexican_hat import half_size_pix, mexican_hat
from survey_mc.detect._wavdetect.thresholds import Thresholds, cornish_fisher, freeman_threshold

TAIL = 1e-4
SCALES_PIX = [2.0 ** (k / 2.0) for k in range(9)]
# Inversion of the characteristic function and Freeman's formulas at 1e-4, by an independent program.
EXACT = {
    BACKGROUND_10KS: [6.59, 7.97, 10.29, 13.59, 18.22, 24.76, 33.99, 47.04, 65.5],
    BACKGROUND_100KS: [15.37, 20.10, 27.39, 37.71, 52.30, 72.92, 102.1, 143.4, 201.9],
}
FREEMAN = {
    BACKGROUND_10KS: [6.97, 8.61, 10.63, 13.14, 19.68, 26.41, 35.93, 49.40, 68.4],
    BACKGROUND_100KS: [16.27, 21.60, 29.12, 39.77, 54.82, 76.12, 106.2, 148.8, 209.0],
}
# Counts of a King source on a pixel centre that reach the exact threshold.
N_MIN = {
    BACKGROUND_10KS: [19.8, 15.1, 13.6, 13.8, 15.3, 18.0, 22.4, 28.8, 37.9],
    BACKGROUND_100KS: [46.2, 38.0, 36.2, 38.3, 43.8, 53.1, 67.2, 87.7, 117.0],
}


def threshold(kind, sigma_pix, background, tail=TAIL):
    return float(Thresholds(kind, sigma_pix, (tail,)).at(np.array([background]), tail)[0])


def king_correlation(sigma_pix):
    """W⋆D per count of a King source centred on a pixel."""
    half = half_size_pix(sigma_pix)
    subsamples = 15 if sigma_pix < 4.0 else 5
    fine = (np.arange((2 * half + 1) * subsamples) + 0.5) / subsamples - half - 0.5
    light = TestPsf().surface_brightness(4.0 * np.hypot(fine[:, None], fine)) * 16.0 / subsamples**2
    pixels = light.reshape(2 * half + 1, subsamples, 2 * half + 1, subsamples).sum(axis=(1, 3))
    return float((mexican_hat(sigma_pix) * pixels).sum())


@pytest.mark.parametrize("background", EXACT)
def test_exact_thresholds_are_those_of_the_characteristic_function(background):
    found = [threshold("exact", sigma, background) for sigma in SCALES_PIX]
    np.testing.assert_allclose(found, EXACT[background], rtol=2.5e-3)


@pytest.mark.parametrize("background", FREEMAN)
def test_freeman_thresholds_are_the_published_fit(background):
    found = [threshold("freeman", sigma, background) for sigma in SCALES_PIX]
    np.testing.assert_allclose(found, FREEMAN[background], rtol=1e-3)


@pytest.mark.parametrize("background", N_MIN)
def test_faintest_source_of_every_scale(background):
    found = [threshold("exact", s, background) / king_correlation(s) for s in SCALES_PIX]
    np.testing.assert_allclose(found, N_MIN[background], rtol=0.01)


@pytest.mark.parametrize("sigma_pix", [5.7, 16.0])
@pytest.mark.parametrize("background", [0.01, 0.178, 3.0])
def test_large_scales_may_share_the_table_of_a_smaller_one(sigma_pix, background):
    direct = filter_threshold(mexican_hat(sigma_pix), background, TAIL)
    assert threshold("exact", sigma_pix, background) == pytest.approx(direct, rel=2e-3)


@pytest.mark.parametrize("kind", ["freeman", "exact"])
def test_interpolation_between_tabulated_backgrounds_is_close(kind):
    for background in (0.03, 0.21, 1.3):
        if kind == "exact":
            direct = filter_threshold(mexican_hat(2.0), background, TAIL)
        else:
            direct = float(freeman_threshold(np.array([8.0 * np.pi * background]), TAIL)[0])
        assert threshold(kind, 2.0, background) == pytest.approx(direct, rel=4e-3)


@pytest.mark.parametrize("kind", ["freeman", "exact"])
@pytest.mark.parametrize("tail", [1e-2, 1e-3, 1e-4, 1e-6])
def test_bound_that_leaves_pixels_out_is_below_the_threshold(kind, tail):
    background = np.geomspace(1e-3, 30.0, 12)
    for sigma_pix in (1.0, 2.0, 8.0):
        thresholds = Thresholds(kind, sigma_pix, (tail,), least=2.0)
        assert np.all(thresholds.certainly_above(tail) * np.sqrt(background) < thresholds.at(background, tail))


def test_stricter_tail_has_a_higher_threshold_and_all_meet_the_gaussian_limit():
    bright = 1e4
    for tail, sigmas in ((1e-3, 3.090), (1e-4, 3.719), (1e-6, 4.753)):
        expected = sigmas * math.sqrt(bright) * Thresholds("exact", 2.0, (tail,)).norm
        assert threshold("exact", 2.0, bright, tail) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("sigma_pix", [1.0, 4.0])
def test_distribution_and_its_expansion_for_many_counts_meet(sigma_pix):
    kernel = mexican_hat(sigma_pix)
    many = 2e4 / kernel.size
    noise = math.sqrt(many * np.square(kernel).sum())
    assert cornish_fisher(kernel, many, TAIL) == pytest.approx(filter_threshold(kernel, many, TAIL) / noise, rel=1e-3)


def test_threshold_is_never_below_the_least_nor_undefined_without_background():
    thresholds = Thresholds("exact", 1.0, (TAIL,), least=4.0)
    found = thresholds.at(np.array([0.0, 1e-9, 1e-3]), TAIL)
    assert np.all(found >= 4.0)
    assert np.all(np.isfinite(found))


def test_exact_threshold_cuts_the_tail_of_a_drawn_field():
    # 12 fields of 256²: 78.6 pixels expected above 1e-4, correlated in groups of a few: ±45 % is beyond 3.9σ.
    rng = np.random.default_rng(90)
    limit = threshold("exact", 1.0, 0.178)
    hat = mexican_hat(1.0)
    above = 0
    for _ in range(12):
        field = np.fft.rfft2(rng.poisson(0.178, (256, 256)))
        kernel = np.zeros((256, 256))
        kernel[: hat.shape[0], : hat.shape[1]] = hat
        above += int((np.fft.irfft2(field * np.fft.rfft2(kernel), s=(256, 256)) > limit).sum())
    assert 43 < above < 114
