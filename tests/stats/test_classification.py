"""Point against extended: closed forms, and sums that agree with the arrays they are of."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stats_frames import match_rows

from survey_mc.stats.classification import (
    PAPER_CUT,
    auc,
    auc_interval_fields,
    called_extended,
    classification_rates,
    confusion_by_field,
    contamination_curve,
)
from survey_mc.stats.extent_sums import ExtentSums, class_of, listed_by_field
from survey_mc.stats.intervals import ONE_SIGMA, jeffreys
from survey_mc.stats.match_rows import MatchRows
from survey_mc.stats.resampling import field_weights

SEPARATION = 1.2
AUC_OF_NORMALS = 0.5 * (1.0 + math.erf(SEPARATION / 2.0))  # Φ(d/√2) for two unit normals d apart
VALUES = st.lists(st.tuples(st.integers(-5, 5), st.booleans()), min_size=2, max_size=40)


def two_normals(rng, n_point, n_extended):
    is_extended = np.arange(n_point + n_extended) >= n_point
    return rng.normal(size=len(is_extended)) + SEPARATION * is_extended, is_extended


def test_area_of_two_normals_is_the_closed_form():
    # Hanley & McNeil: σ = 0.0032 for 4000 of each; 4 σ
    assert auc(*two_normals(np.random.default_rng(1), 4000, 4000)) == pytest.approx(AUC_OF_NORMALS, abs=0.013)


def test_statistic_without_information_has_half_the_area():
    assert auc(np.ones(7), np.arange(7) < 3) == 0.5


@settings(max_examples=60, deadline=None)
@given(VALUES)
def test_area_of_the_opposite_direction_is_the_rest(rows):
    values, is_extended = np.array(rows, dtype=float).T
    area = auc(values, is_extended > 0)
    assert np.isnan(area) or area + auc(values, is_extended > 0, larger_is_extended=False) == pytest.approx(1.0)


def test_area_interval_covers_as_often_as_it_says():
    rng = np.random.default_rng(2)
    n_trials, n_inside = 100, 0
    for _ in range(n_trials):
        values, is_extended = two_normals(rng, 200, 60)
        lower, upper = auc_interval_fields(values, is_extended, rng.integers(0, 40, 260), rng, n_resamples=100)
        n_inside += lower <= AUC_OF_NORMALS <= upper
    # binomial(100, 0.68): σ = 4.7; 1e-4 odds at 3.9 σ
    assert abs(n_inside - ONE_SIGMA * n_trials) < 3.9 * 4.7


@settings(max_examples=60, deadline=None)
@given(VALUES, st.booleans())
def test_threshold_of_the_curve_gives_its_numbers(rows, larger):
    values, is_extended = np.array(rows, dtype=float).T
    for row in contamination_curve(values, is_extended > 0, larger).itertuples():
        reached = values >= row.threshold if larger else values <= row.threshold
        assert row.n_extended_called == np.count_nonzero(reached & (is_extended > 0))
        assert row.n_other_called == np.count_nonzero(reached & (is_extended == 0))


def test_thinned_curve_keeps_both_ends():
    values, is_extended = two_normals(np.random.default_rng(3), 900, 100)
    full, thin = (contamination_curve(values, is_extended, n_max=n) for n in (10_000, 40))
    assert len(full) == 1000
    assert 15 < len(thin) <= 41
    assert thin.iloc[[0, -1]].to_numpy().tolist() == full.iloc[[0, -1]].to_numpy().tolist()
    assert thin["completeness"].diff().max() < 0.1


def test_matrix_and_rates_by_hand():
    true_class = np.array([0, 0, 0, 1, 1, 2, 3, -1])
    is_called = np.array([True, False, False, True, False, True, False, True])
    confusion = confusion_by_field(true_class, is_called, np.arange(8) % 2, 2)
    assert confusion.sum(axis=0).tolist() == [[2, 1], [1, 1], [0, 1], [1, 0]]
    assert confusion[1].sum() == 3
    rates = classification_rates(confusion, np.empty((0, 2)))
    fractions = {name: (rate.n_found, rate.n_tried) for name, rate in rates.items()}
    assert fractions == {"completeness": (1, 2), "contamination": (2, 3), "false_extended": (1, 3), "wrong": (3, 7)}
    assert (rates["wrong"].lower, rates["wrong"].upper) == tuple(map(float, jeffreys(3, 7)))
    assert np.isnan(rates["wrong"].lower_fields)


def test_nothing_called_has_no_contamination():
    rates = classification_rates(np.zeros((1, 4, 2), dtype=int), np.empty((0, 1)))
    assert np.isnan(rates["contamination"].value)
    assert (rates["contamination"].lower, rates["contamination"].upper) == (0.0, 1.0)


def test_unmeasured_detection_is_called_point():
    assert called_extended(np.array([np.nan, 20.0, 19.9]), 20.0).tolist() == [False, True, False]
    assert called_extended(np.array([np.nan, 0.1, 0.09]), 0.1, larger_is_extended=False).tolist() == [
        False,
        False,
        True,
    ]


def test_joint_cut_needs_all_four():
    good = {"stellarity": 0.05, "r50_arcsec": 20.0, "counts": 21.0, "offaxis_arcmin": 9.0}
    for change, called in (
        ({}, True),
        ({"stellarity": 0.1}, False),
        ({"r50_arcsec": 19.9}, False),
        ({"counts": 20.0}, False),
        ({"offaxis_arcmin": 10.0}, False),
        ({"stellarity": np.nan}, False),
    ):
        values = {name: np.array([value]) for name, value in (good | change).items()}
        assert PAPER_CUT.called_extended(**values).tolist() == [called]


@pytest.mark.parametrize("larger", [True, False])
def test_sums_over_pieces_agree_with_the_arrays(larger):
    rng = np.random.default_rng(5)
    values, is_extended = two_normals(rng, 3000, 700)
    values = np.exp(values) if larger else 1.0 / (1.0 + np.exp(3.0 * values))
    values[::50] = np.nan
    cut, field = (2.0, 0.3)[not larger], rng.integers(0, 30, len(values))
    sums = ExtentSums(cut, larger, 30)
    for rows in np.array_split(rng.permutation(len(values)), 3):
        sums.add(values[rows], is_extended[rows].astype(np.int64), field[rows])
    is_called = called_extended(values, cut, larger)
    assert (sums.confusion == confusion_by_field(is_extended.astype(int), is_called, field, 30)).all()
    assert sums.n_unmeasured == 74
    assert sums.auc(field_weights(30, rng))[0] == pytest.approx(auc(values, is_extended, larger), abs=2e-3)
    assert sums.median(1) == pytest.approx(np.nanmedian(values[is_extended]), rel=0.04)
    curve = sums.curve(field_weights(30, rng))
    assert curve["n_extended_called"].iloc[-1] == 700
    assert (curve["contamination_lower_fields"] <= curve["contamination_upper_fields"]).all()
    at_cut = contamination_curve(values, is_extended, larger)
    exact = np.interp(curve["completeness"], at_cut["completeness"], at_cut["contamination"])
    assert curve["contamination"][5:].to_numpy() == pytest.approx(exact[5:], abs=0.03)


def test_class_of_a_detection_is_its_sources_kind_or_what_else_it_is():
    status = np.array(["matched", "duplicate", "faint", "blend", "spurious", "outside", "missed", "matched"], object)
    kind = np.array(["extended", "extended", "point", "point", "", "point", "extended", "image"], object)
    rows = MatchRows.of(match_rows(8, status=status, kind_true=kind))
    assert class_of(rows).tolist() == [1, 1, 0, 2, 3, -1, -1, -1]
    called = np.ones(8, dtype=bool)
    assert listed_by_field(rows, called, np.arange(8) % 2, 2).tolist() == [[1, 2], [0, 0]]
