"""Intervals against known values and exact coverage."""

import numpy as np
import pytest
from scipy.stats import binom, poisson

from survey_mc.stats.intervals import ONE_SIGMA, clopper_pearson, garwood, jeffreys, wilson

FRACTIONS = np.linspace(0.5, 0.995, 400)


def coverage(interval, n):
    """Exact coverage at each of FRACTIONS."""
    k = np.arange(n + 1)
    lower, upper = interval(k, np.full(n + 1, n))
    covers = (lower[:, None] <= FRACTIONS) & (upper[:, None] >= FRACTIONS)
    return (binom.pmf(k[:, None], n, FRACTIONS) * covers).sum(axis=0)


@pytest.mark.parametrize(
    ("interval", "n", "expected"),
    [
        (wilson, 10, 0.691), (jeffreys, 10, 0.690), (clopper_pearson, 10, 0.848),
        (wilson, 30, 0.683), (jeffreys, 30, 0.683), (clopper_pearson, 30, 0.791),
        (wilson, 100, 0.681), (jeffreys, 100, 0.681), (clopper_pearson, 100, 0.747),
    ],
)  # fmt: skip
def test_mean_coverage_is_the_known_one(interval, n, expected):
    assert coverage(interval, n).mean() == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("n", [1, 7, 40])
def test_clopper_pearson_never_covers_less_than_it_says(n):
    assert coverage(clopper_pearson, n).min() >= ONE_SIGMA - 1e-12


@pytest.mark.parametrize("interval", [jeffreys, clopper_pearson, wilson])
def test_no_success_starts_at_zero_and_no_failure_ends_at_one(interval):
    lower, upper = interval([0, 5], [5, 5])
    assert lower[0] == 0.0
    assert upper[1] == 1.0
    assert 0.0 < upper[0] < 0.5 < lower[1] < 1.0


@pytest.mark.parametrize("interval", [jeffreys, wilson])
def test_no_trials_say_nothing(interval):
    lower, upper = interval(0, 0)
    assert (lower, upper) == (0.0, 1.0)


@pytest.mark.parametrize("interval", [jeffreys, clopper_pearson, wilson])
def test_success_and_failure_are_mirror_images(interval):
    k = np.arange(13)
    lower, upper = interval(k, 12)
    assert lower == pytest.approx(1.0 - upper[::-1])


def test_clopper_pearson_ends_are_binomial_tails():
    lower, upper = clopper_pearson(8, 10, 0.95)
    assert binom.sf(7, 10, lower) == pytest.approx(0.025)
    assert binom.cdf(8, 10, upper) == pytest.approx(0.025)


def test_more_found_than_tried_is_refused():
    with pytest.raises(ValueError, match="between 0 and n_tried"):
        jeffreys(3, 2)


def test_garwood_of_nothing_counted_is_the_known_upper_limit():
    lower, upper = garwood(0)
    assert (lower, upper) == (0.0, pytest.approx(1.841, abs=5e-4))


def test_garwood_agrees_with_gehrels_tables():
    # Gehrels 1986, Tables 1 and 2, S = 1 (0.8413 one-sided)
    lower, upper = garwood([1, 5, 20])
    assert lower == pytest.approx([0.173, 2.840, 15.57], abs=0.006)
    assert upper == pytest.approx([3.300, 8.382, 25.55], abs=0.006)


def test_garwood_ends_are_poisson_tails():
    lower, upper = garwood(7, 0.9)
    assert poisson.sf(6, lower) == pytest.approx(0.05)
    assert poisson.cdf(7, upper) == pytest.approx(0.05)
