"""Which sources a group needs: the fall of C each is worth, extents, and splitting.

Idea     every question is a comparison of two fits to the same pixels: with and without a source, as a point and
         extended, as one and as two sources. Score tests at the fitted model decide which comparisons are worth a fit:
         a squared score approximates the fall of C.
Source   XMM-SAS task emldetect (mlmin, dmlextmin, nmulsou, withtwostage); Cash 1979; Rao 1948 for the score test.
Limits   the worth of a source is taken with refitted neighbours only where they overlap it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from survey_mc.detect._eml.fit import (
    AMPLITUDE,
    EXTENT,
    IS_EXTENDED,
    IS_SPLIT,
    N_SOURCE_COLUMNS,
    PIX_BACKGROUND,
    PIX_X,
    PIX_Y,
    X_HIGH,
    X_LOW,
    Y_HIGH,
    Y_LOW,
    X,
    Y,
    fit,
)
from survey_mc.detect._eml.params import LARGEST_GROUP, Limits
from survey_mc.detect._eml.pixels import parts_of
from survey_mc.detect._eml.score_kernels import falls_alone, fill_scores, largest_excesses
from survey_mc.types import BoolArray, FloatArray

TINY = np.finfo(np.float64).tiny  # stands for 0 in a division
PROMISE = 0.55  # share of the wanted fall of C that a score test must promise before a fit is made
HOPE = 0.5  # share of the wanted fall that makes another start worth trying
SPLIT_APART_PIX = 1.0  # a new source starts at least this far from the others
SPLIT_STARTS = 12  # pixels with the largest excess that are tried
PAST_EXTENT = 2.0  # sources overlap an extended one within this many extents more


@dataclass(frozen=True, slots=True)
class Problem:
    """The pixels of one group, the table of shapes and the limits."""

    pixels: FloatArray
    table: FloatArray
    limits: Limits


@dataclass(frozen=True, slots=True)
class Solution:
    """Fitted sources (n, N_SOURCE_COLUMNS), C counted from the background alone, lower half of the Fisher matrix."""

    sources: FloatArray
    cash: float
    fisher: FloatArray
    converged: bool = True


def new_fisher(sources: FloatArray) -> FloatArray:
    """Room for the Fisher matrix: three parameters for a point, four for an extended source."""
    n = 3 * len(sources) + int(np.count_nonzero(sources[:, IS_EXTENDED]))
    return np.zeros((n, n))


def run_fit(sources: FloatArray, problem: Problem, held: int, fisher: FloatArray) -> tuple[float, bool]:
    """`_eml.fit.fit` of the problem, in place."""
    cash, converged = fit(sources, problem.pixels, problem.table, problem.limits.blend_pix, held, fisher)
    return float(cash), bool(converged)


def solve(sources: FloatArray, problem: Problem) -> Solution:
    """The best fit from these sources on; without sources C is 0."""
    fitted = sources.copy()
    fisher = new_fisher(fitted)
    if not len(fitted):
        return Solution(fitted, 0.0, fisher)
    cash, converged = run_fit(fitted, problem, -1, fisher)
    return Solution(fitted, cash, fisher, converged)


def set_bounds(sources: FloatArray, limits: Limits) -> None:
    """Bound the positions around where they are, and to the image; in place."""
    shift = min(limits.max_shift_pix, limits.cut_pix)  # further off, only wings would be fitted
    for source in sources:
        x, y = float(source[X]), float(source[Y])
        source[X_LOW], source[Y_LOW] = max(x - shift, 0.0), max(y - shift, 0.0)
        source[X_HIGH], source[Y_HIGH] = min(x + shift, limits.width - 1.0), min(y + shift, limits.height - 1.0)


def overlapping(sources: FloatArray, k: int, reach_pix: float, limits: Limits) -> BoolArray:
    """Which other sources share photons with number k: those within the reach, more if one is extended."""
    near = np.zeros(len(sources), np.bool_)
    if len(sources) > 1:
        apart = np.hypot(sources[:, X] - sources[k, X], sources[:, Y] - sources[k, Y])
        extended = sources[:, IS_EXTENDED] != 0.0
        if extended.any():
            extent = np.where(extended, limits.extent_pix(sources[:, EXTENT]), 0.0)
            apart -= PAST_EXTENT * (extent + extent[k])
        near = apart < reach_pix
        near[k] = False
    return near


def model_of(solution: Solution, problem: Problem) -> FloatArray:
    """(n_pixels,) expected counts."""
    parts = parts_of(solution.sources, problem.pixels, problem.table)
    return np.asarray(problem.pixels[PIX_BACKGROUND] + (parts[0] if len(parts) == 1 else parts.sum(axis=0)))


def falls(solution: Solution, problem: Problem) -> FloatArray:
    """By how much each source makes C fall, the others refitted where they overlap it."""
    sources, limits = solution.sources, problem.limits
    fall = np.full(len(sources), -solution.cash)
    if len(sources) < 2:
        return fall
    falls_alone(parts_of(sources, problem.pixels, problem.table), problem.pixels, solution.cash, fall)
    for k in range(len(sources)):
        if fall[k] >= limits.point_fall and overlapping(sources, k, limits.overlap_pix, limits).any():
            fall[k] = min(fall[k], solve(np.delete(sources, k, axis=0), problem).cash - solution.cash)
    return fall


def likelihood_falls(solution: Solution, fall: FloatArray, problem: Problem) -> FloatArray:
    """The falls DET_ML is taken from: of each source beside the brighter ones, without the fainter ones on it.

    fall: what each is worth beside all others. A bright source split in two would have little of it, as either half
    can stand for both.
    """
    sources, limits = solution.sources, problem.limits
    seen = fall.copy()
    for k in range(len(sources) if len(sources) > 1 else 0):
        fainter = overlapping(sources, k, limits.overlap_pix, limits) & (sources[:, AMPLITUDE] < sources[k, AMPLITUDE])
        if fainter.any():
            with_it = solve(sources[~fainter], problem)
            place = k - int(np.count_nonzero(fainter[:k]))
            seen[k] = max(fall[k], solve(np.delete(with_it.sources, place, axis=0), problem).cash - with_it.cash)
    return seen


def wanted_falls(sources: FloatArray, limits: Limits) -> FloatArray:
    """The fall of C each source has to be worth."""
    return np.where(sources[:, IS_EXTENDED] != 0.0, limits.extended_fall, limits.point_fall)


def pruned(solution: Solution, problem: Problem, fall: FloatArray | None = None) -> tuple[Solution, FloatArray]:
    """The sources that pay, refitted, and their falls; the least needed are taken away one after the other.

    fall: the falls if they are known already.
    """
    while True:
        fall = falls(solution, problem) if fall is None else fall
        margin = fall - wanted_falls(solution.sources, problem.limits)
        if not len(margin) or margin.min() >= 0.0:
            return solution, fall
        solution, fall = solve(np.delete(solution.sources, int(np.argmin(margin)), axis=0), problem), None


def shape_sums(shapes: FloatArray, model: FloatArray, problem: Problem) -> FloatArray:
    """(3, n) slope, Fisher information, and that shared with the first one, of sources of one count each."""
    sums = np.empty((3, len(shapes)))
    fill_scores(problem.pixels, model, parts_of(shapes, problem.pixels, problem.table), sums)
    return sums


def extent_scores(solution: Solution, k: int, problem: Problem) -> FloatArray:
    """Fall of C that a part of source k with each starting extent promises; 0 if the residuals want less of it."""
    starts, (x_pix, y_pix) = problem.limits.extent_starts, solution.sources[k, : Y + 1]
    trial = np.zeros((1 + len(starts), N_SOURCE_COLUMNS))
    trial[:, X], trial[:, Y], trial[:, AMPLITUDE] = x_pix, y_pix, 1.0
    trial[1:, IS_EXTENDED], trial[1:, EXTENT] = 1.0, starts
    slope, fisher, both = shape_sums(trial, model_of(solution, problem), problem)
    mixed = both[1:] / fisher[0]
    score = np.maximum(slope[1:] - slope[0] * mixed, 0.0)
    return np.asarray(score**2 / np.maximum(fisher[1:] - mixed * both[1:], TINY))


def promising_extent(solution: Solution, k: int, problem: Problem) -> bool:
    """Whether an extent of source k is worth a fit."""
    return bool(extent_scores(solution, k, problem).max() > PROMISE * problem.limits.extent_fall)


def as_extended(solution: Solution, k: int, problem: Problem) -> Solution:
    """The best fit with source k extended; the solution as it is if none is good.

    The most promising start is tried first, the other promising ones only if it brings at least half of what is wanted.
    """
    best, limits = solution, problem.limits
    promise = extent_scores(solution, k, problem)
    order = np.argsort(-promise, kind="stable")
    for start in limits.extent_starts[order[promise[order] > PROMISE * limits.extent_fall]]:
        trial = solution.sources.copy()
        trial[k, IS_EXTENDED], trial[k, EXTENT] = 1.0, start
        fitted = solve(trial, problem)
        if solution.cash - fitted.cash < HOPE * limits.extent_fall:
            break
        if fitted.cash < best.cash and fitted.sources[k, EXTENT] >= limits.extent_min_place:
            best = fitted
    return best if solution.cash - best.cash >= limits.extent_fall else solution


def residual_peak(solution: Solution, k: int, problem: Problem) -> tuple[FloatArray, float]:
    """One more point near source k where it promises most, and the fall of C it promises (0: nowhere)."""
    sources, pixels, cut_pix = solution.sources, problem.pixels, problem.limits.cut_pix
    model, places = model_of(solution, problem), np.empty(SPLIT_STARTS, np.int64)
    places = places[: largest_excesses(sources, k, pixels, model, SPLIT_APART_PIX, cut_pix, places)]
    if not places.size:
        return sources[k], 0.0
    trial = np.zeros((len(places), N_SOURCE_COLUMNS))
    trial[:, X], trial[:, Y], trial[:, AMPLITUDE] = pixels[PIX_X, places], pixels[PIX_Y, places], 1.0
    slope, fisher, _ = shape_sums(trial, model, problem)
    promise = np.maximum(slope, 0.0) ** 2 / fisher
    best = int(np.argmax(promise))
    point = sources[k].copy()
    point[X], point[Y], point[AMPLITUDE] = trial[best, X], trial[best, Y], max(slope[best], 0.0) / fisher[best]
    point[IS_EXTENDED], point[IS_SPLIT] = 0.0, 1.0
    return point, float(promise[best])


def with_source(solution: Solution, source: FloatArray, problem: Problem) -> Solution:
    """The fit with one more source, if that pays; the solution as it is otherwise."""
    if len(solution.sources) >= LARGEST_GROUP:
        return solution
    more = solve(np.vstack([solution.sources, source]), problem)
    wanted = wanted_falls(source[None], problem.limits)[0]
    return more if solution.cash - more.cash >= wanted else solution


def split(solution: Solution, k: int, problem: Problem) -> Solution:
    """The sources with one more point near number k, if that pays; the solution as it is otherwise."""
    point, promise = residual_peak(solution, k, problem)
    if promise < PROMISE * problem.limits.point_fall:
        return solution
    set_bounds(point[None], problem.limits)
    return with_source(solution, point, problem)


def worth(solution: Solution, limits: Limits) -> float:
    """C after each source has paid for itself; the smaller the better."""
    return solution.cash + float(wanted_falls(solution.sources, limits).sum())


def instead_extended(solution: Solution, k: int, problem: Problem) -> Solution:
    """Source k extended in place of itself and the points that overlap it, where that is the better model.

    First one extended source alone, then the overlapping ones again and new points, as far as each pays. Its rival is
    the point split into points: a close pair is no extended source.
    """
    sources, limits = solution.sources, problem.limits
    near = overlapping(sources, k, limits.blend_pix, limits) & (sources[:, IS_EXTENDED] == 0.0)
    if (sources[near, AMPLITUDE] > sources[k, AMPLITUDE]).any():
        return solution
    alone = solve(sources[~near], problem) if near.any() else solution
    place = k - int(np.count_nonzero(near[:k]))
    wide = as_extended(alone, place, problem)
    if wide is alone:
        return solution
    for j in np.flatnonzero(near):
        wide = with_source(wide, sources[j], problem)
    points = solution
    for _ in range(limits.n_mul_sou - 1):
        wide, points = split(wide, place, problem), split(points, k, problem)
    return min(solution, points, wide, key=lambda model: worth(model, limits))


def point_rise(solution: Solution, k: int, problem: Problem) -> float:
    """By how much C rises if extended source k becomes a point, all refitted."""
    trial = solution.sources.copy()
    trial[k, IS_EXTENDED] = 0.0
    return solve(trial, problem).cash - solution.cash
