import numpy as np
import pytest
from stats_frames import match_rows

from survey_mc.stats import Astrometry, Photometry
from survey_mc.stats.selections import ABOVE_LIMIT


def pick(table, selection, **where):
    rows = table[table["selection"] == selection]
    for name, value in where.items():
        rows = rows[rows[name] == value]
    assert len(rows) == 1
    return rows.iloc[0]


def test_each_ratio_has_the_denominator_of_its_name():
    photometry = Photometry()
    photometry.add(match_rows(1, status="matched", counts=30.0, counts_onaxis=60.0, counts_expected=40.0,
                              flux_cgs=1e-15, flux_true_cgs=4e-15))  # fmt: skip
    table = photometry.table()
    means = {ratio: pick(table, "all", ratio=ratio)["mean"] for ratio in table["ratio"].unique()}
    assert means == {"counts / counts_onaxis": 0.5, "counts / counts_expected": 0.75, "flux / flux_true": 0.25}


def test_median_quantiles_mean_and_spread_of_known_ratios():
    rng = np.random.default_rng(1)
    ratio = np.exp(rng.normal(0.1, 0.3, 4000))
    rows = match_rows(4000, status="matched", counts=100 * ratio, counts_onaxis=100.0, counts_expected=100.0)
    photometry = Photometry()
    for piece in np.array_split(np.arange(4000), 5):
        photometry.add(rows.iloc[piece])
    row = pick(photometry.table(), "all", ratio="counts / counts_onaxis")
    assert row["n"] == 4000
    assert row["median"] == pytest.approx(np.median(ratio), rel=0.005)
    assert (row["q16"], row["q84"]) == pytest.approx(np.quantile(ratio, (0.16, 0.84)), rel=0.006)
    assert (row["mean"], row["stdev"]) == pytest.approx((ratio.mean(), ratio.std(ddof=1)))
    # standard error of a median: 1.2533 σ/√n in the logarithm; the interval's half width is that within 10 %
    half = np.log(row["median_upper"] / row["median_lower"]) / 2
    assert half == pytest.approx(1.2533 * 0.3 / np.sqrt(4000), rel=0.15)


def test_only_matched_rows_are_measured():
    photometry, astrometry = Photometry(), Astrometry()
    rows = match_rows(3, status=np.array(["missed", "duplicate", "spurious"], dtype=object), counts=10.0,
                      counts_onaxis=10.0, sep_arcsec=1.0)  # fmt: skip
    photometry.add(rows)
    astrometry.add(rows)
    assert len(photometry.table()) == len(astrometry.table()) == 0


def test_bright_selections_are_strict_and_the_flux_limit_takes_whole_bins():
    flux = np.array([1e-15, 1.9e-15, 2.1e-15, 1e-13])
    rows = match_rows(4, status="matched", counts_onaxis=[50.0, 51.0, 100.0, 101.0], sep_arcsec=[1.0, 2.0, 3.0, 4.0],
                      flux_true_cgs=flux)  # fmt: skip
    astrometry = Astrometry()
    astrometry.add(rows)
    table = astrometry.table(flux_limit_cgs=1.95e-15)
    assert pick(table, "counts_onaxis > 50")["n"] == 3
    assert pick(table, "counts_onaxis > 100")["n"] == 1
    above = pick(table, ABOVE_LIMIT)
    assert (above["n"], above["lower_edge"]) == (2, pytest.approx(10**-14.7))


def test_rayleigh_separations_give_its_quantiles():
    rng = np.random.default_rng(3)
    sigma, n = 1.3, 5000
    astrometry = Astrometry()
    astrometry.add(match_rows(n, status="matched", sep_arcsec=rng.rayleigh(sigma, n), counts_onaxis=30.0))
    row = pick(astrometry.table(), "all")
    # 3.9σ: the median of a Rayleigh sample has a standard error of about 0.85 σ/√n·… < 0.016 σ here
    assert row["median_arcsec"] == pytest.approx(sigma * np.sqrt(2 * np.log(2)), abs=0.08)
    assert row["one_sigma_arcsec"] == pytest.approx(sigma * np.sqrt(-2 * np.log(1 - 0.6827)), abs=0.09)
    assert row["rms_arcsec"] == pytest.approx(sigma * np.sqrt(2), rel=0.03)
