"""Resampled fields: they know what the binomial interval does not."""

import numpy as np
import pytest

from survey_mc import stats
from survey_mc.stats.intervals import ONE_SIGMA, jeffreys
from survey_mc.stats.resampling import (
    design_effect,
    field_weights,
    fraction_interval_fields,
    inner_quantiles,
    n_field_groups,
    resampled_sums,
)


def test_every_resample_has_as_many_fields_as_there_are():
    weights = field_weights(23, np.random.default_rng(1), 50)
    assert weights.shape == (50, 23)
    assert (weights.sum(axis=1) == 23).all()


def test_single_field_says_nothing():
    weights = field_weights(n_field_groups(1), np.random.default_rng(1))
    lower, upper = fraction_interval_fields(weights, np.array([3]), np.array([5]))
    assert weights.shape == (0, 1)
    assert np.isnan([lower, upper, design_effect(np.array([3]), np.array([5]))]).all()


def test_sums_are_those_of_the_drawn_fields():
    weights = np.array([[2.0, 0.0, 1.0]])
    by_group = np.array([[[1, 0], [2, 0]], [[10, 0], [20, 0]], [[100, 0], [200, 0]]])
    assert resampled_sums(weights, by_group).tolist() == [[[102, 0], [204, 0]]]


def test_quantiles_are_numpys_of_what_is_known():
    values = np.random.default_rng(2).normal(size=(31, 3))
    values[::4, 1] = np.nan
    values[:, 2] = np.nan
    ends = inner_quantiles(values, 0.5)
    assert ends[:, 0] == pytest.approx(np.quantile(values[:, 0], (0.25, 0.75)))
    assert ends[:, 1] == pytest.approx(np.nanquantile(values[:, 1], (0.25, 0.75)))
    assert np.isnan(ends[:, 2]).all()


def test_design_effect_of_sources_that_share_their_fate_is_their_number():
    rng = np.random.default_rng(3)
    n_fields, clumps, size = 4000, 5, 6
    found = size * rng.binomial(clumps, 0.4, n_fields)
    # the variance of a sample variance of 4000 near-normal values: σ = 2.2 %; 4 σ
    assert design_effect(found, np.full(n_fields, size * clumps)) == pytest.approx(size, rel=0.09)


def test_interval_of_fields_covers_where_the_binomial_one_does_not():
    rng = np.random.default_rng(4)
    n_trials, n_fields, clumps, size, true = 300, 60, 4, 5, 0.3
    inside = np.zeros(2)
    for _ in range(n_trials):
        found, tried = size * rng.binomial(clumps, true, n_fields), np.full(n_fields, size * clumps)
        ends = fraction_interval_fields(field_weights(n_fields, rng, 200), found, tried)
        binomial = jeffreys(found.sum(), tried.sum())
        inside += [lower <= true <= upper for lower, upper in (ends, binomial)]
    # binomial(300, 0.68): σ = 8.1; 1e-4 odds at 3.9 σ. Jeffreys is √5 too short and covers erf(1/√10) = 0.345.
    assert abs(inside[0] - ONE_SIGMA * n_trials) < 3.9 * 8.1
    assert abs(inside[1] - 0.345 * n_trials) < 3.9 * 8.3


def test_public_names_exist_and_say_what_they_are():
    for name in stats.__all__:
        thing = getattr(stats, name)
        assert not callable(thing) or len(thing.__doc__) > 20
