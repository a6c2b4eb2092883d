"""Exact Poisson thresholds and the few-event significance table."""

from __future__ import annotations

import math
import time
import tracemalloc

import numpy as np
import pytest
from detect_fields import TestPsf, profile_offsets_pix

from survey_mc.detect._mr1 import few_event
from survey_mc.detect._shared import exact_threshold, smoothing

# Tail above 4σ and 5σ, and thresholds (σ) of two tails, of a flat field smoothed by a Gaussian: FWHM ″, b per pixel.
SMOOTHED_TAILS = [
    (12.0, 0.178, 9.9e-4, 1.2e-4, 5.06, 5.56),
    (12.0, 1.78, 1.7e-4, 6e-6, 4.17, 4.53),
    (20.0, 0.178, 4.2e-4, 2.9e-5, 4.56, 4.97),
    (20.0, 1.78, 9.8e-5, 2e-6, 4.00, 4.32),
]

# n photons: t_min, t_max of the reduced coefficient at ε = 1e-3, then at ε = 1e-4.
FEW_EVENT_TABLE = {
    4: (-1.419, 5.948, -1.664, 7.528),
    8: (-1.535, 5.090, -1.771, 6.715),
    16: (-1.685, 4.606, -1.923, 5.934),
    32: (-1.892, 4.199, -2.134, 5.352),
    64: (-2.151, 3.898, -2.412, 4.915),
    128: (-2.419, 3.675, -2.732, 4.587),
    256: (-2.626, 3.511, -3.022, 4.346),
    512: (-2.767, 3.391, -3.232, 4.169),
    1024: (-2.864, 3.305, -3.379, 4.041),
    2048: (-2.932, 3.243, -3.480, 3.948),
    4096: (-2.979, 3.199, -3.551, 3.882),
    8192: (-3.012, 3.167, -3.601, 3.835),
    16384: (-3.035, 3.145, -3.636, 3.801),
}
TABLE_ROUNDING = 1.1e-3  # printed to three decimals, both sides computed numerically


def kernel_of(fwhm_arcsec: float) -> np.ndarray:
    return smoothing.gaussian_kernel(smoothing.sigma_pix_from_fwhm(fwhm_arcsec, 4.0))


@pytest.mark.parametrize(("fwhm", "b", "tail4", "tail5", "at_1e4", "at_32e6"), SMOOTHED_TAILS)
def test_tails_of_a_smoothed_poisson_field(fwhm, b, tail4, tail5, at_1e4, at_32e6):
    kernel = kernel_of(fwhm)
    sigma = math.sqrt(b * np.square(kernel).sum())
    assert exact_threshold.filter_tail(kernel, b, b + 4 * sigma) == pytest.approx(tail4, rel=0.02)
    assert exact_threshold.filter_tail(kernel, b, b + 5 * sigma) == pytest.approx(tail5, rel=0.25)
    for false_alarm, expected in ((1e-4, at_1e4), (3.2e-5, at_32e6)):
        found = (exact_threshold.filter_threshold(kernel, b, false_alarm) - b) / sigma
        assert found == pytest.approx(expected, abs=0.01)


def test_one_pixel_filter_gives_the_poisson_tail():
    # P(n ≥ 3 | 0.178) in closed form; the threshold lies between two and three counts.
    tail = 1.0 - math.exp(-0.178) * (1 + 0.178 + 0.178**2 / 2)
    assert exact_threshold.filter_tail(np.ones(1), 0.178, 2.5) == pytest.approx(tail, rel=1e-6)


def test_threshold_grows_with_background_and_falls_with_false_alarm():
    kernel = kernel_of(12.0)
    by_background = [exact_threshold.filter_threshold(kernel, b, 1e-5) - b for b in (0.01, 0.1, 1.0, 10.0)]
    by_alarm = [exact_threshold.filter_threshold(kernel, 0.178, p) for p in (1e-2, 1e-4, 1e-6, 1e-8)]
    assert np.all(np.diff(by_background) > 0)
    assert np.all(np.diff(by_alarm) > 0)


def test_threshold_map_interpolates_the_exact_values():
    kernel = kernel_of(12.0)
    background = np.array([[0.05, 0.178], [0.33, 1.9]])
    excess = exact_threshold.excess_threshold_map(kernel, background, 1e-5)
    exact = [exact_threshold.filter_threshold(kernel, b, 1e-5) - b for b in background.ravel()]
    np.testing.assert_allclose(excess.ravel(), exact, rtol=3e-3)


def test_too_small_false_alarm_is_refused_by_name():
    with pytest.raises(ValueError, match="false_alarm must be at least"):
        exact_threshold.filter_threshold(np.ones(3), 1.0, 1e-15)


@pytest.mark.parametrize("n_photons", FEW_EVENT_TABLE)
def test_few_event_thresholds_agree_with_the_table(n_photons):
    p = int(math.log2(n_photons))
    coarse, fine = few_event.abaque(1e-3), few_event.abaque(1e-4)
    found = (coarse.lower[p], coarse.upper[p], fine.lower[p], fine.upper[p])
    np.testing.assert_allclose(found, FEW_EVENT_TABLE[n_photons], atol=TABLE_ROUNDING)


def test_standard_deviation_of_the_mother_wavelet():
    assert few_event.abaque(1e-3).sigma_psi == pytest.approx(0.04073, abs=5e-6)


def test_thresholds_tend_to_the_gaussian_ones():
    lower, upper = few_event.thresholds(np.array([2.0**17, 1e8, 1e12]), few_event.abaque(1e-4))
    assert np.all(np.diff(upper) < 0)
    assert upper[-1] == pytest.approx(3.719, abs=1e-3)
    assert lower[-1] == pytest.approx(-3.719, abs=1e-3)


def test_thresholds_are_linear_in_log_n_between_octaves():
    table = few_event.abaque(1e-4)
    _, upper = few_event.thresholds(np.array([64.0, 64.0 * math.sqrt(2.0), 128.0]), table)
    assert upper[1] == pytest.approx(0.5 * (upper[0] + upper[2]))


def test_fewer_photons_than_min_events_are_never_significant():
    lower, upper = few_event.coefficient_limits(1e-4, 4)
    assert np.all(np.isinf(upper[:4]))
    assert np.all(np.isinf(lower[:4]))
    assert np.all(np.isfinite(upper[4:]))


def test_building_the_table_is_quick():
    few_event.abaque.cache_clear()
    start = time.process_time()
    few_event.abaque(2e-4)
    # Half a second on the slowest machine we know; a guard against an order of magnitude, not a benchmark.
    assert time.process_time() - start < 5.0


@pytest.mark.parametrize(("fwhm_arcsec", "noise", "peak"), [(12.0, 0.2214, 0.0365), (20.0, 0.1329, 0.0188)])
def test_smoothing_has_the_known_noise_and_peak(fwhm_arcsec, noise, peak):
    sigma_pix = smoothing.sigma_pix_from_fwhm(fwhm_arcsec, 4.0)
    assert smoothing.noise_norm(sigma_pix) == pytest.approx(noise, abs=1e-4)
    rng = np.random.default_rng(31)
    n = 400_000
    # The peak is the mean over where in its pixel the source lies.
    place = profile_offsets_pix(rng, n, TestPsf.core_radius_arcsec, TestPsf.slope) + rng.uniform(-0.5, 0.5, (n, 2))
    pixel = np.rint(place).astype(int) + 30
    inside = np.all((pixel >= 0) & (pixel <= 60), axis=1)
    photons = np.zeros((61, 61))
    np.add.at(photons, (pixel[inside, 1], pixel[inside, 0]), 1.0)
    # 4e5 photons through a kernel that averages tens of pixels: 1.5 % is more than 4σ.
    assert smoothing.smooth(photons, sigma_pix)[30, 30] / n == pytest.approx(peak, rel=0.015)


def test_normalised_smoothing_has_no_edge_and_no_mask_edge():
    weight = np.ones((80, 90))
    weight[:, :30] = 0.0
    flat = np.where(weight > 0, 3.0, 0.0)
    smoothed = smoothing.normalised_smoothing(flat, weight, 1.3)
    np.testing.assert_allclose(smoothed[:, 30:], 3.0, rtol=1e-12)


def test_noise_grows_along_an_edge_as_predicted():
    observed = np.ones((64, 64), dtype=bool)
    observed[:, :20] = False
    sigma_pix = 1.5
    rng = np.random.default_rng(12)
    noise = rng.normal(size=(600, 64, 64)) * observed
    values = np.array([smoothing.normalised_smoothing(n, observed.astype(float), sigma_pix)[32, 20] for n in noise])
    expected = smoothing.edge_noise_factor(observed, sigma_pix)[32, 20] * smoothing.noise_norm(sigma_pix)
    # Standard deviation of 600 values is known to 2.9 %: 4σ.
    assert values.std() == pytest.approx(expected, rel=0.12)


def test_equal_kernels_are_kept_once():
    """A table entry a background, each with a kernel of 2 MB as its key, would fill the memory of a worker."""
    kernel = smoothing.gaussian_kernel(64.0)
    exact_threshold._reduced_threshold.cache_clear()
    tracemalloc.start()
    for background in 2.0 ** np.arange(-4.0, 0.0, 0.5):
        exact_threshold.excess_threshold_map(kernel.copy(), np.full((1, 1), background), 1e-3)
    kept_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept_bytes < 2.5 * kernel.nbytes
