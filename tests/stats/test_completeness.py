"""Completeness and its limit against a logistic curve whose 90 % point is known."""

import numpy as np
import pytest
from stats_frames import match_rows

from survey_mc.stats.bins import COUNTS_BINS, FLUX_BINS
from survey_mc.stats.completeness import CompletenessCounts, crossings, rising_fractions

LOG_HALF, WIDTH = -15.0, 0.12
LOG_90 = LOG_HALF + WIDTH * np.log(0.9 / 0.1)


def logistic_fields(rng, n_fields, n_sources=60):
    log_flux = rng.uniform(-16.0, -14.0, n_fields * n_sources)
    found = rng.random(len(log_flux)) < 1.0 / (1.0 + np.exp(-(log_flux - LOG_HALF) / WIDTH))
    return match_rows(
        len(log_flux),
        realisation=np.repeat(np.arange(n_fields), n_sources),
        flux_true_cgs=10.0**log_flux,
        status=np.where(found, "matched", "missed").astype(object),
    )


def counted(rows, n_fields, bins=FLUX_BINS):
    counts = CompletenessCounts(bins, n_fields)
    counts.add(rows)
    return counts


def test_fractions_are_found_over_true():
    status = np.array(["matched", "missed", "matched", "matched", "spurious", "outside", "duplicate"], dtype=object)
    flux = [1.1e-15, 1.1e-15, 1.2e-15, 5e-15, 1.1e-15, 1.1e-15, 1.1e-15]
    table = counted(match_rows(7, status=status, flux_true_cgs=flux), 1).table(np.random.default_rng(0))
    assert table["n_true"].tolist() == [3, 1]
    assert table["n_found"].tolist() == [2, 1]
    assert table["completeness"].tolist() == [2 / 3, 1.0]
    assert table["centre"].iloc[0] == pytest.approx((1.1e-15**2 * 1.2e-15) ** (1 / 3))
    assert table[["lower_fields", "design_effect"]].isna().all(axis=None)


def test_known_limit_is_inside_its_interval_as_often_as_it_says():
    rng = np.random.default_rng(4)
    n_trials, n_inside, values = 40, 0, []
    for _ in range(n_trials):
        limit = counted(logistic_fields(rng, 40), 40).limits(rng, n_resamples=150)[2]
        n_inside += limit.lower <= 10.0**LOG_90 <= limit.upper
        values.append(np.log10(limit.value))
    # binomial(40, 0.683): σ = 2.9; the odds of falling outside ±3.9σ are 1e-4
    assert 0.683 * n_trials - 11.5 < n_inside <= n_trials
    assert np.mean(values) == pytest.approx(LOG_90, abs=0.03)


def test_limits_rise_with_their_level():
    rng = np.random.default_rng(6)
    limits = counted(logistic_fields(rng, 20), 20).limits(rng, 50)
    assert [x.level for x in limits] == [0.5, 0.8, 0.9]
    assert limits[0].value < limits[1].value < limits[2].value
    assert limits[0].value == pytest.approx(10.0**LOG_HALF, rel=0.1)


def test_interpolation_is_linear_between_bin_centres():
    centres = np.array([-16.0, -15.0, -14.0])
    at_50, _, at_90 = crossings(centres, np.array([0, 80, 100]), np.array([100, 100, 100]))
    assert at_50 == pytest.approx(-16.0 + 0.5 / 0.8)
    assert at_90 == pytest.approx(-14.5)


def test_dip_is_pooled_with_its_neighbour():
    centres = np.array([-16.0, -15.0, -14.0, -13.0])
    dip = crossings(centres, np.array([0, 90, 70, 100]), np.array([100, 100, 100, 100]))
    pooled = crossings(centres, np.array([0, 80, 80, 100]), np.array([100, 100, 100, 100]))
    assert dip == pytest.approx(pooled)


def test_rising_fractions_are_the_weighted_isotonic_regression():
    from scipy.optimize import isotonic_regression

    rng = np.random.default_rng(8)
    n_true = rng.integers(0, 40, (50, 23))
    n_found = rng.binomial(n_true, np.linspace(0.1, 0.95, 23))
    many = rising_fractions(n_found, n_true)
    for found, true, rising in zip(n_found, n_true, many, strict=True):
        used = true > 0
        expected = isotonic_regression(found[used] / true[used], weights=true[used].astype(float)).x
        np.testing.assert_allclose(rising[used], expected, rtol=1e-12)


def test_pooling_weighs_bins_by_their_sources():
    centres = np.array([-16.0, -15.0, -14.0, -13.0])
    at_90 = crossings(centres, np.array([0, 90, 7, 1000]), np.array([100, 100, 10, 1000]))[2]
    assert at_90 == pytest.approx(-14.0 + (0.9 - 97 / 110) / (1.0 - 97 / 110))


def test_bins_without_sources_are_passed_over():
    centres = np.array([np.nan, -15.0, np.nan, -14.0, np.nan])
    at_50 = crossings(centres, np.array([0, 20, 0, 80, 0]), np.array([0, 100, 0, 100, 0]))[0]
    assert at_50 == pytest.approx(-14.5)


def test_no_source_at_all_reaches_no_level():
    assert np.isposinf(crossings(np.full(3, np.nan), np.zeros(3, int), np.zeros(3, int))).all()


@pytest.mark.parametrize(("status", "state"), [("missed", "not reached"), ("matched", "below range")])
def test_limit_that_is_not_in_range_is_said_to_be_so(status, state):
    rows = match_rows(40, realisation=np.arange(40) % 4, status=status, flux_true_cgs=np.geomspace(1e-16, 1e-14, 40))
    limit = counted(rows, 4).limits(np.random.default_rng(1), 20)[2]
    assert np.isnan(limit.value)
    assert limit.state == state


def test_one_field_has_a_limit_but_no_interval():
    rng = np.random.default_rng(3)
    limit = counted(logistic_fields(rng, 1, 3000), 1).limits(rng, 50)[2]
    assert limit.value == pytest.approx(10.0**LOG_90, rel=0.2)
    assert np.isnan([limit.lower, limit.upper]).all()


def test_pieces_in_any_split_give_the_same_table():
    rows = logistic_fields(np.random.default_rng(5), 12)
    pieces = CompletenessCounts(FLUX_BINS, 12)
    for realisation in (11, 3, *range(3), *range(4, 11)):
        pieces.add(rows[rows["realisation"] == realisation])
    one = counted(rows, 12).table(np.random.default_rng(0), 20)
    assert one.equals(pieces.table(np.random.default_rng(0), 20)) or np.allclose(
        one.to_numpy(), pieces.table(np.random.default_rng(0), 20).to_numpy(), equal_nan=True
    )


def test_design_effect_is_one_for_independent_sources_and_large_for_fields_found_whole():
    rng = np.random.default_rng(9)
    n_fields, n_sources = 300, 20
    realisation = np.repeat(np.arange(n_fields), n_sources)
    alone = rng.random(len(realisation)) < 0.6
    together = np.repeat(rng.random(n_fields) < 0.6, n_sources)
    effects = []
    for found in (alone, together):
        rows = match_rows(len(found), realisation=realisation, counts_expected=20.0,
                          status=np.where(found, "matched", "missed").astype(object))  # fmt: skip
        effects.append(counted(rows, n_fields, COUNTS_BINS).table(rng, 2)["design_effect"].iloc[0])
    # χ²/ν of 300 fields: σ = √(2/300) = 0.08
    assert effects[0] == pytest.approx(1.0, abs=0.32)
    assert effects[1] == pytest.approx(n_sources, rel=0.1)


def test_memory_does_not_grow_with_the_number_of_realisations():
    assert CompletenessCounts(FLUX_BINS, 10**6).n_true.nbytes < 1e6
