import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey_mc.stats.bins import FLUX_BINS
from survey_mc.stats.histograms import Histograms

EDGES = np.linspace(-5.0, 5.0, 2001)  # steps of 0.005


def test_round_fluxes_are_edges_and_belong_to_the_bin_above():
    flux = np.array([1e-16, 1e-15, 1e-14, 1e-13])
    assert np.array_equal(FLUX_BINS.edges[FLUX_BINS.index(flux)], flux)


def test_values_without_a_bin_are_not_counted():
    counts = FLUX_BINS.count(np.array([np.nan, 0.0, -1.0, 1e-18, 2e-15, 1.0]))
    assert counts.sum() == 2
    assert counts[-1] == 1


@given(st.lists(st.floats(-4.9, 4.9), min_size=1, max_size=200))
def test_histogram_quantiles_are_within_a_step_of_the_order_statistics(values):
    histograms = Histograms(1, EDGES)
    histograms.add(np.zeros(len(values), dtype=np.int64), np.array(values))
    summary = histograms.summary(np.array([True]))
    for fraction in (0.16, 0.5, 0.84):
        low, high = (np.quantile(values, fraction, method=m) for m in ("inverted_cdf", "higher"))
        assert min(low, high) - 0.0051 <= summary.quantile(fraction) <= max(low, high) + 0.0051
    assert summary.mean == pytest.approx(np.mean(values), abs=1e-9)


def test_pieces_in_any_split_give_the_same_sums():
    rng = np.random.default_rng(2)
    group, values = rng.integers(-1, 4, 500), rng.normal(size=500)
    whole, pieces = Histograms(3, EDGES), Histograms(3, EDGES)
    whole.add(group, values)
    for part in np.array_split(np.arange(500), 7):
        pieces.add(group[part], values[part])
    everything = np.ones(3, dtype=bool)
    assert np.array_equal(whole.counts, pieces.counts)
    assert whole.summary(everything).stdev == pytest.approx(values[(group >= 0) & (group < 3)].std(ddof=1))


def test_interval_of_the_median_covers_the_true_one_as_often_as_it_says():
    rng = np.random.default_rng(8)
    n_covered = 0
    for _ in range(400):
        histograms = Histograms(1, EDGES)
        histograms.add(np.zeros(60, dtype=np.int64), rng.normal(0.3, 1.0, 60))
        lower, upper = histograms.summary(np.array([True])).quantile_interval(0.5)
        n_covered += lower <= 0.3 <= upper
    # binomial(400, 0.683) has σ = 9.3; ±3.9σ is a 1e-4 false alarm, and discreteness of ranks adds a few per cent
    assert 0.683 * 400 - 36 < n_covered < 0.683 * 400 + 50


def test_nothing_gives_nan_and_not_zero():
    summary = Histograms(1, EDGES).summary(np.array([True]))
    assert summary.n == 0
    assert np.isnan([summary.mean, summary.stdev, summary.rms, summary.quantile(0.5)]).all()
