"""The maximum-likelihood fit against closed forms and independent minimisers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from detect_fields import BACKGROUND_10KS, BACKGROUND_100KS, SCALE_ARCSEC
from ml_problems import PSF, exact_pixels, problem_of, source_rows
from scipy import optimize, stats

from survey_mc.detect._eml import fit as ml_fit
from survey_mc.detect._eml import psf_table
from survey_mc.detect._eml.params import (
    EXTENT_NU,
    POINT_NU,
    cut_radius_pix,
    fall_of_likelihood,
    likelihood,
)
from survey_mc.detect._eml.pixels import parts_of
from survey_mc.detect._eml.selection import (
    Problem,
    as_extended,
    extent_scores,
    falls,
    likelihood_falls,
    set_bounds,
    solve,
)

Z = 4.0  # two-sided odds of 6e-5 for each comparison


@pytest.fixture(scope="module")
def table():
    return psf_table.psf_table(PSF, SCALE_ARCSEC, "beta")


@pytest.mark.parametrize("place", [None, 12.4])
def test_gradient_and_fisher_matrix_are_those_of_cash(table, place):
    rng = np.random.default_rng(402)
    counts = rng.poisson(0.3, (25, 25))
    sources = source_rows((11.8, 12.3, 60.0), (15.1, 10.2, 30.0), place=place)
    pixels = problem_of(counts, 0.3, table, 11.0).pixels
    columns = [0, 1, 2] if place is None else [0, 1, 2, 3]
    n = len(sources) * len(columns)
    gradient, fisher, spare = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    ml_fit.cash_and_slopes(sources, pixels, table.cubics, 100.0, gradient, fisher)

    def model(at: np.ndarray) -> np.ndarray:
        moved = sources.copy()
        moved[:, columns] = at.reshape(len(sources), -1)
        return pixels[ml_fit.PIX_BACKGROUND] + parts_of(moved, pixels, table.cubics).sum(axis=0)

    def cash(at: np.ndarray) -> float:
        moved = sources.copy()
        moved[:, columns] = at.reshape(len(sources), -1)
        return ml_fit.cash_and_slopes(moved, pixels, table.cubics, 100.0, np.zeros(n), spare)

    at = sources[:, columns].ravel()
    step = 1e-5
    slopes = np.array([(model(at + step * e) - model(at - step * e)) / (2 * step) for e in np.eye(n)])
    numeric = np.array([(cash(at + step * e) - cash(at - step * e)) / (2 * step) for e in np.eye(n)])
    assert np.allclose(-2.0 * gradient, numeric, rtol=1e-4, atol=1e-5 * np.abs(numeric).max())
    whole = np.tril(fisher) + np.tril(fisher, -1).T
    assert np.allclose(whole, (slopes / model(at)) @ slopes.T, rtol=1e-4, atol=1e-6 * whole.max())
    m, n_photons = model(at), pixels[ml_fit.PIX_COUNTS]
    b = pixels[ml_fit.PIX_BACKGROUND]
    assert cash(at) == pytest.approx(2.0 * ((m - b).sum() - (n_photons * np.log(m / b)).sum()), rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_fit_finds_the_minimum_a_simplex_finds(table, seed):
    rng = np.random.default_rng([403, seed])
    truth = BACKGROUND_10KS + 80.0 * exact_pixels(12, 0.2, -0.3) + 50.0 * exact_pixels(12, 4.0, 2.0)
    problem = problem_of(rng.poisson(truth), BACKGROUND_10KS, table, 12.0)
    start = source_rows((12.8, 11.2, 40.0), (15.4, 14.5, 90.0))
    found = solve(start, problem)

    def cash(at: np.ndarray) -> float:
        trial = start.copy()
        trial[:, :3] = at.reshape(2, 3)
        trial[:, 2] = np.abs(trial[:, 2])
        model = parts_of(trial, problem.pixels, problem.table).sum(axis=0)
        background, counts = problem.pixels[ml_fit.PIX_BACKGROUND], problem.pixels[ml_fit.PIX_COUNTS]
        return float(2.0 * (model.sum() - (counts * np.log1p(model / background)).sum()))

    options = {"maxiter": 6000, "xatol": 1e-4, "fatol": 1e-6, "adaptive": True}
    simplex = optimize.minimize(cash, start[:, :3].ravel(), method="Nelder-Mead", options=options)
    assert found.cash <= simplex.fun + 0.01
    assert found.cash == pytest.approx(cash(found.sources[:, :3].ravel()), abs=1e-6)


# Cramér-Rao limits of an isolated source on the middle of a pixel, all of the plane fitted: σ_x (arcsec) and relative
# error of the counts, computed from the Fisher matrix of the King profile.
CRAMER_RAO = [
    (BACKGROUND_10KS, 50.0, 0.90, 0.18),
    (BACKGROUND_10KS, 100.0, 0.61, 0.12),
    (BACKGROUND_10KS, 300.0, 0.34, 0.065),
    (BACKGROUND_100KS, 100.0, 0.77, 0.15),
    (BACKGROUND_100KS, 300.0, 0.38, 0.076),
]


@pytest.mark.parametrize(("background", "counts", "sigma_arcsec", "share"), CRAMER_RAO)
def test_errors_reach_the_cramer_rao_limit(table, background, counts, sigma_arcsec, share):
    rng = np.random.default_rng([404, int(counts)])
    n, found = 150, []
    for _ in range(n):
        dx, dy = rng.uniform(-0.5, 0.5, 2)
        image = rng.poisson(background + counts * exact_pixels(17, dx, dy, 6))
        problem = problem_of(image, background, table)
        solution = solve(source_rows((17.0 + dx, 17.0 + dy, counts)), problem).sources[0]
        found.append((solution[0] - 17.0 - dx, solution[1] - 17.0 - dy, solution[2] / counts - 1.0))
    offset = np.array(found)
    scatter = SCALE_ARCSEC * math.sqrt(np.square(offset[:, :2]).mean())
    # 2n offsets know their scatter to 1/√4n; 8 % for the place of the source within its pixel and the finite radius
    assert abs(scatter / sigma_arcsec - 1.0) < Z / math.sqrt(4 * n) + 0.08
    assert abs(offset[:, 2].std() / share - 1.0) < Z / math.sqrt(2 * n) + 0.08
    assert abs(offset[:, 2].mean()) < Z * share / math.sqrt(n) + 0.005
    assert np.abs(offset[:, :2].mean(axis=0)).max() * SCALE_ARCSEC < Z * sigma_arcsec / math.sqrt(n)


@pytest.mark.parametrize(("value", "nu", "half_fall"), [(10, 3, 11.38), (10, 4, 12.61), (6, 3, 7.17), (6, 4, 8.22)])
def test_likelihoods_correspond_to_falls_of_cash(value, nu, half_fall):
    assert fall_of_likelihood(value, nu) / 2.0 == pytest.approx(half_fall, abs=0.01)
    assert float(likelihood(np.array(2.0 * half_fall), nu)) == pytest.approx(value, abs=0.01)


def test_likelihood_is_the_tail_of_chi_square_and_finite_for_any_fall():
    for nu in (1, 3, 4):
        fall = np.array([0.5, 8.0, 60.0, 600.0])
        assert np.allclose(likelihood(fall, nu), -stats.chi2.logsf(fall, nu), rtol=1e-6)
    falls_on = np.geomspace(1.0, 1e8, 400)
    assert np.all(np.diff(likelihood(falls_on, POINT_NU)) > 0.0)
    assert np.isfinite(likelihood(np.array([0.0, 1e12]), EXTENT_NU)).all()


# Counts at which the expected image reaches DET_ML 5, 6 and 10, the whole plane fitted.
ASIMOV = [(BACKGROUND_10KS, 11.6, 12.9, 17.2), (BACKGROUND_100KS, 30.1, 33.0, 42.8), (0.24, 13.1, 14.4, 19.2)]


@pytest.mark.parametrize(("background", "five", "six", "ten"), ASIMOV)
def test_expected_images_reach_the_thresholds_at_the_published_counts(table, background, five, six, ten):
    shape = exact_pixels(20, 0.0, 0.0)
    for counts, value in ((five, 5.0), (six, 6.0), (ten, 10.0)):
        problem = problem_of(background + counts * shape, background, table, 20.0)
        solution = solve(source_rows((20.0, 20.0, counts)), problem)
        assert float(likelihood(falls(solution, problem), POINT_NU)[0]) == pytest.approx(value, rel=0.03)


def test_neighbours_are_refitted_to_judge_a_source(table):
    image = BACKGROUND_10KS + 200.0 * exact_pixels(17, 0.0, 0.0)
    problem = problem_of(image, BACKGROUND_10KS, table)
    doubled = solve(source_rows((17.0, 17.0, 100.0), (17.3, 17.0, 100.0)), problem)
    single = solve(source_rows((17.0, 17.0, 200.0)), problem)
    assert falls(single, problem)[0] > 500.0
    assert falls(doubled, problem).max() < 1.0


def test_a_bright_source_keeps_its_likelihood_when_it_is_split(table):
    image = BACKGROUND_10KS + 500.0 * exact_pixels(17, -0.7, 0.0) + 200.0 * exact_pixels(17, 0.9, 0.0)
    problem = problem_of(image, BACKGROUND_10KS, table)
    both = solve(source_rows((16.3, 17.0, 500.0), (17.9, 17.0, 200.0)), problem)
    single = solve(source_rows((17.0, 17.0, 700.0)), problem)
    fall = falls(both, problem)
    judged = likelihood_falls(both, fall, problem)
    assert judged[0] == pytest.approx(-single.cash, rel=1e-3)
    assert judged[0] > 5.0 * fall[0]
    assert judged[1] == fall[1]


def test_extent_is_measured_and_points_have_none(table):
    rng = np.random.default_rng(405)
    # an extent of 5.7 pixels and 2000 counts: known to about 5 %
    sources = source_rows((24.0, 24.0, 2000.0), place=24.0)
    blank = problem_of(np.zeros((49, 49)), BACKGROUND_10KS, table, 20.0)
    for trial in range(3):
        drawn = rng.poisson(BACKGROUND_10KS + parts_of(sources, blank.pixels, table.cubics)[0])
        pixels = blank.pixels.copy()
        pixels[ml_fit.PIX_COUNTS] = drawn
        problem = Problem(pixels, table.cubics, blank.limits)
        point = solve(source_rows((24.0, 24.0, 300.0)), problem)
        wide = as_extended(point, 0, problem)
        assert wide.sources[0, ml_fit.IS_EXTENDED] == 1.0, trial
        assert blank.limits.extent_pix(wide.sources[0, ml_fit.EXTENT]) == pytest.approx(table.extent_pix[24], rel=0.2)
    point_image = rng.poisson(BACKGROUND_10KS + 600.0 * exact_pixels(24, 0.1, 0.2, 6))
    problem = problem_of(point_image, BACKGROUND_10KS, table, 20.0)
    point = solve(source_rows((24.0, 24.0, 300.0)), problem)
    assert extent_scores(point, 0, problem).max() < 15.0
    assert as_extended(point, 0, problem) is point


def test_cuts_are_fractions_of_the_psf_or_pixels():
    assert cut_radius_pix(PSF, SCALE_ARCSEC, 0.68) * SCALE_ARCSEC == pytest.approx(13.5, abs=0.1)
    assert cut_radius_pix(PSF, SCALE_ARCSEC, 0.90) * SCALE_ARCSEC == pytest.approx(52.8, abs=0.2)
    assert cut_radius_pix(PSF, SCALE_ARCSEC, 12.0) == 12.0


def test_bounds_keep_sources_on_the_image(table):
    limits = problem_of(np.zeros((35, 35)), 0.1, table).limits
    sources = source_rows((1.0, 33.0, 1.0))
    set_bounds(sources, limits)
    assert sources[0, ml_fit.X_LOW] == 0.0
    assert sources[0, ml_fit.Y_HIGH] == 34.0
