"""The fit of all candidates of an image: brightest first, neighbours together, accepted models into the background.

Idea     the brightest candidate left takes its neighbours with it; the group is fitted, pruned, tested for extents and
         splitting, and its sources are added to the background the next groups see.
Source   control flow of the XMM-SAS task emldetect (scut, ecut, nmaxfit, nmulsou, mlmin, dmlextmin, withtwostage).
Limits   every candidate is fitted once; a neighbour beyond the group waits its turn and is not in the model before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from survey_mc.detect._eml.fit import (
    AMPLITUDE,
    CANDIDATE,
    EXTENT,
    IS_EXTENDED,
    IS_SPLIT,
    LEAST_AMPLITUDE,
    N_SOURCE_COLUMNS,
    PIX_BACKGROUND,
    X_HIGH,
    X_LOW,
    X,
    Y,
)
from survey_mc.detect._eml.params import Limits
from survey_mc.detect._eml.pixels import Images, add_model, collect, observed_share, parts_of
from survey_mc.detect._eml.selection import (
    Problem,
    Solution,
    as_extended,
    instead_extended,
    likelihood_falls,
    new_fisher,
    point_rise,
    promising_extent,
    pruned,
    run_fit,
    set_bounds,
    solve,
    split,
)
from survey_mc.detect._shared.poisson_background import LEAST_BACKGROUND_PER_PIX
from survey_mc.types import BoolArray, FloatArray, IntArray

AT_BOUND, EXTENT_AT_MAX, NOT_CONVERGED, PARTLY_OBSERVED, SPLIT, NEIGHBOUR_DROPPED, ERRORS_UNSURE = (
    2**bit for bit in range(7)
)
NEGLIGIBLE_SHARE = 0.01  # of the background: a model is added to it out to where it falls below this
FULLY_OBSERVED = 0.99  # share of the model inside the cut radius
SETTLED_SHARE = 0.12  # of the cut radius: a source that moved further gets its pixels chosen anew
MAX_SETTLING = 3
PROFILE_STEPS = 3
PROFILE_RISE = (0.01, 100.0)  # rises of C beyond which the parabola is not trusted


@dataclass(frozen=True, slots=True)
class Fitted:
    """Accepted sources, arrays (n,) or (n, …).

    sources: columns of `_eml.fit`. errors: (n, 4) of x, y, amplitude and place of the extent. fall, extent_fall: of C.
    group: number of the fit; n_together: sources in it. background: counts per pixel at the source before it was added.
    """

    sources: FloatArray
    errors: FloatArray
    fall: FloatArray
    extent_fall: FloatArray
    flags: IntArray
    group: IntArray
    n_together: IntArray
    background: FloatArray
    observed_share: FloatArray

    def row(self, k: int) -> Fitted:
        """Source k alone."""
        return Fitted(*(getattr(self, field.name)[k : k + 1] for field in fields(self)))


def settle(images: Images, sources: FloatArray, table: FloatArray, limits: Limits) -> tuple[Solution, Problem]:
    """First fit of a group; its pixels are chosen anew while a source leaves the middle of its own."""
    problem = Problem(collect(images, sources, limits.cut_pix), table, limits)
    solution = solve(sources, problem)
    for _ in range(MAX_SETTLING - 1):
        if np.hypot(*(solution.sources - sources)[:, [X, Y]].T).max() <= SETTLED_SHARE * limits.cut_pix:
            break
        sources = solution.sources
        problem = Problem(collect(images, sources, limits.cut_pix), table, limits)
        solution = solve(sources, problem)
    return solution, problem


def with_splits(images: Images, solution: Solution, problem: Problem, limits: Limits) -> tuple[Solution, Problem]:
    """The points split where that pays; a new source brings its own pixels."""
    for k in range(len(solution.sources)):
        n_new = limits.n_mul_sou - 1 if solution.sources[k, IS_EXTENDED] == 0.0 else 0
        for _ in range(n_new):
            more = split(solution, k, problem)
            if more is not solution:
                solution, problem = settle(images, more.sources, problem.table, limits)
    return solution, problem


def with_extents(solution: Solution, problem: Problem) -> Solution:
    """The fit with the extents that pay, each in place of the points it explains."""
    k = 0
    while k < len(solution.sources):
        if solution.sources[k, IS_EXTENDED] == 0.0:
            solution = instead_extended(solution, k, problem)
        k += 1
    return solution


def judged(solution: Solution, problem: Problem, known: FloatArray | None) -> tuple[Solution, FloatArray, FloatArray]:
    """The sources and extents that pay, with the falls of C they are worth; known: the falls of the sources."""
    while True:
        solution, fall = pruned(solution, problem, known)
        rises = np.full(len(fall), np.inf)
        for wide in np.flatnonzero(solution.sources[:, IS_EXTENDED]):
            rises[wide] = point_rise(solution, int(wide), problem)
        if not len(rises) or rises.min() >= problem.limits.extent_fall:
            return solution, fall, np.where(np.isinf(rises), 0.0, rises)
        points = solution.sources.copy()
        points[int(np.argmin(rises)), IS_EXTENDED] = 0.0
        solution, known = solve(points, problem), None


def profile_error(solution: Solution, k: int, column: int, parameter: int, error: float, problem: Problem) -> float:
    """Mean offset of one parameter, up and down, that raises C by 1 with all others refitted."""
    total = 0.0
    for side in (-1.0, 1.0):
        offset = error
        for _ in range(PROFILE_STEPS):
            trial = solution.sources.copy()
            trial[k, column] += side * offset
            if column == AMPLITUDE:
                trial[k, column] = max(trial[k, column], LEAST_AMPLITUDE)
            offset = abs(trial[k, column] - solution.sources[k, column])
            cash = run_fit(trial, problem, parameter, new_fisher(trial))[0]
            offset /= math.sqrt(min(max(cash - solution.cash, PROFILE_RISE[0]), PROFILE_RISE[1]))
        total += 0.5 * offset
    return total


def fisher_errors(fisher: FloatArray) -> tuple[FloatArray, bool]:
    """√ of the diagonal of the inverse of a matrix given by its lower half; with all others held if it is singular."""
    diagonal = fisher.diagonal().copy()
    whole = fisher + fisher.T
    np.fill_diagonal(whole, diagonal)
    scale = 1.0 / np.sqrt(np.maximum(diagonal, np.finfo(np.float64).tiny))
    try:
        variance = np.linalg.inv(whole * scale * scale[:, None]).diagonal() * scale**2
    except np.linalg.LinAlgError:
        variance = np.full(len(scale), np.nan)
    regular = bool(np.all(variance > 0.0) and np.all(diagonal > 0.0))
    return (np.sqrt(variance), True) if regular else (np.where(diagonal > 0.0, scale, np.nan), False)


def errors_and_flags(solution: Solution, problem: Problem) -> tuple[FloatArray, IntArray]:
    """(n, 4) errors of the parameters, and the flags the fit itself raises."""
    n = len(solution.sources)
    all_errors, regular = fisher_errors(solution.fisher)
    errors, flags, at = np.full((n, 4), np.nan), np.zeros(n, np.int32), 0
    flags += (0 if solution.converged else NOT_CONVERGED) + (0 if regular else ERRORS_UNSURE)
    for k, source in enumerate(solution.sources):
        columns = (X, Y, AMPLITUDE, EXTENT) if source[IS_EXTENDED] != 0.0 else (X, Y, AMPLITUDE)
        for j, column in enumerate(columns):
            errors[k, j] = all_errors[at + j]
            if problem.limits.profile_errors and column != EXTENT and regular:
                errors[k, j] = profile_error(solution, k, column, at + j, float(errors[k, j]), problem)
        at += len(columns)
    place = solution.sources[:, [X, Y]]
    bounded = (place <= solution.sources[:, X_LOW : X_LOW + 2]) | (place >= solution.sources[:, X_HIGH : X_HIGH + 2])
    widest = (solution.sources[:, IS_EXTENDED] != 0.0) & (solution.sources[:, EXTENT] >= len(problem.table) - 2)
    flags |= np.where(bounded.any(axis=1), AT_BOUND, 0) | np.where(widest, EXTENT_AT_MAX, 0)
    flags |= np.where(solution.sources[:, IS_SPLIT] != 0.0, SPLIT, 0)
    return errors, flags.astype(np.int32)


def fit_group(images: Images, sources: FloatArray, table: FloatArray, limits: Limits, group: int) -> Fitted:
    """Fit one group and add what is accepted to the background."""
    solution, problem = settle(images, sources, table, limits)
    solution, fall = pruned(solution, problem)
    points = solution
    if limits.two_stage:
        solution = with_extents(solution, problem)
    solution, problem = with_splits(images, solution, problem, limits)
    measured = measure(images, solution, problem, group, fall if solution is points else None)
    n_left = np.count_nonzero(measured.sources[:, IS_SPLIT] == 0.0)
    flags = measured.flags | np.int32(NEIGHBOUR_DROPPED if n_left < len(sources) else 0)
    for source, level in zip(measured.sources, measured.background, strict=True):
        add_model(images, source, table, NEGLIGIBLE_SHARE * level)
    return replace(measured, flags=flags)


def measure(
    images: Images, solution: Solution, problem: Problem, group: int, known: FloatArray | None = None
) -> Fitted:
    """The sources of a fit that pay and lie on observed pixels, with all that is known of them."""
    solution, fall, extent_fall = judged(solution, problem, known)
    n = len(solution.sources)
    if not n:
        return nothing()
    fall = likelihood_falls(solution, fall, problem)
    errors, flags = errors_and_flags(solution, problem)
    column, row = np.floor(solution.sources[:, [X, Y]] + 0.5).astype(np.int64).T
    seen = images.exposure[row, column] > 0.0
    cut_pix = problem.limits.cut_pix
    share = np.array([observed_share(images.exposure, source, problem.table, cut_pix) for source in solution.sources])
    flags |= np.where(share < FULLY_OBSERVED, PARTLY_OBSERVED, 0).astype(np.int32)
    ones = np.ones(n, np.int32)
    columns = (errors, fall, extent_fall, flags, ones * group, ones * n, images.background[row, column], share)
    return Fitted(solution.sources[seen], *(values[seen] for values in columns))


def with_late_extents(images: Images, fitted: Fitted, table: FloatArray, limits: Limits) -> Fitted:
    """Extents of the sources of the finished model, each against all others; the background changes with them."""
    rows = [fitted.row(k) for k in range(len(fitted.sources))]
    for k, row in enumerate(rows):
        source, level = row.sources, float(row.background[0])
        problem = Problem(collect(images, source, limits.cut_pix), table, limits)
        own = parts_of(source, problem.pixels, table)[0]
        problem.pixels[PIX_BACKGROUND] = np.maximum(problem.pixels[PIX_BACKGROUND] - own, LEAST_BACKGROUND_PER_PIX)
        if not promising_extent(Solution(source, 0.0, new_fisher(source)), 0, problem):
            continue
        point = solve(source, problem)
        wide = as_extended(point, 0, problem)
        if wide is point:
            continue
        add_model(images, source[0], table, NEGLIGIBLE_SHARE * level, sign=-1.0)
        found = measure(images, wide, problem, int(row.group[0]))
        if len(found.sources) and found.sources[0, IS_EXTENDED] != 0.0:
            kept = row.flags & (SPLIT | NEIGHBOUR_DROPPED)
            rows[k] = replace(found, flags=found.flags | kept, n_together=row.n_together)
        add_model(images, rows[k].sources[0], table, NEGLIGIBLE_SHARE * level)
    return joined(rows)


def nothing() -> Fitted:
    """No sources."""
    none, whole = np.zeros(0), np.zeros(0, np.int32)
    return Fitted(np.zeros((0, N_SOURCE_COLUMNS)), np.zeros((0, 4)), none, none, whole, whole, whole, none, none)


def gathered(first: int, places: FloatArray, waiting: BoolArray, limits: Limits) -> IntArray:
    """Candidate `first` and its waiting neighbours, brightest first, at most n_max_fit."""
    apart = np.hypot(*(places[first:] - places[first]).T)
    near = np.flatnonzero(waiting[first:] & (apart <= limits.group_pix))[: limits.n_max_fit]
    return np.asarray(near + first, dtype=np.int32)


def fit_candidates(images: Images, candidates: FloatArray, table: FloatArray, limits: Limits) -> Fitted:
    """Accepted sources of all candidates; their models are added to `images.background`.

    candidates: (m, 3) x, y and counts at full exposure, brightest first. table: `PsfTable.cubics`.
    """
    places = np.clip(candidates[:, :2], 0.0, [limits.width - 1.0, limits.height - 1.0])
    waiting = np.ones(len(candidates), np.bool_)
    groups: list[Fitted] = []
    for first in range(len(candidates)):
        if waiting[first]:
            members = gathered(first, places, waiting, limits)
            waiting[members] = False
            sources = np.zeros((len(members), N_SOURCE_COLUMNS))
            sources[:, [X, Y]], sources[:, AMPLITUDE] = places[members], candidates[members, 2]
            sources[:, CANDIDATE] = members
            set_bounds(sources, limits)
            groups.append(fit_group(images, sources, table, limits, len(groups) + 1))
    fitted = joined(groups)
    return with_late_extents(images, fitted, table, limits) if limits.fit_extent and not limits.two_stage else fitted


def joined(parts: list[Fitted]) -> Fitted:
    """All sources of several fits."""
    parts = [nothing(), *parts]
    return Fitted(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Fitted)))
