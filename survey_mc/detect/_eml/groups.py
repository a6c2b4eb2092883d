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
    Y_HIGH,
    Y_LOW,
    X,
    Y,
)
from survey_mc.detect._eml.params import Limits
from survey_mc.detect._eml.pixels import Images, add_model, collect, observed_share, parts_of
from survey_mc.detect._eml.score_kernels import take_neighbours
from survey_mc.detect._eml.selection import (
    TINY,
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
N_PARAMETERS = 4  # of an extended source
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

    def chosen(self, which: BoolArray | slice) -> Fitted:
        """Some of the sources."""
        return Fitted(*(getattr(self, field.name)[which] for field in fields(self)))


def settle(images: Images, sources: FloatArray, table: FloatArray, limits: Limits) -> tuple[Solution, Problem]:
    """First fit of a group; its pixels are chosen anew while a source leaves the middle of its own."""
    problem = Problem(collect(images, sources, limits.cut_pix), table, limits)
    solution = solve(sources, problem)
    for _ in range(MAX_SETTLING - 1):
        moved = solution.sources[:, : Y + 1] - sources[:, : Y + 1]
        if np.hypot(moved[:, X], moved[:, Y]).max() <= SETTLED_SHARE * limits.cut_pix:
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
        if not solution.sources[:, IS_EXTENDED].any():
            return solution, fall, np.zeros(len(fall))
        rises = np.full(len(fall), np.inf)
        for wide in np.flatnonzero(solution.sources[:, IS_EXTENDED]):
            rises[wide] = point_rise(solution, int(wide), problem)
        if rises.min() >= problem.limits.extent_fall:
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


def fisher_errors(solution: Solution) -> tuple[FloatArray, bool]:
    """(n, 4) errors from the inverse Fisher matrix; with all other parameters held, and False, if it is singular."""
    fisher = solution.fisher  # its lower half is filled
    diagonal = fisher.diagonal()
    scale = 1.0 / np.sqrt(np.maximum(diagonal, TINY))
    whole = fisher + fisher.T
    whole.reshape(-1)[:: len(fisher) + 1] = diagonal
    try:
        variance = np.linalg.inv(whole * scale * scale[:, None]).diagonal() * scale**2
    except np.linalg.LinAlgError:
        variance = np.full(len(scale), np.nan)
    regular = bool((variance > 0.0).all() and (diagonal > 0.0).all())
    of_parameters = np.sqrt(variance) if regular else np.where(diagonal > 0.0, scale, np.nan)
    errors, at = np.full((len(solution.sources), N_PARAMETERS), np.nan), 0
    for row, source in zip(errors, solution.sources, strict=True):
        n = N_PARAMETERS - 1 if source[IS_EXTENDED] == 0.0 else N_PARAMETERS
        row[:n] = of_parameters[at : at + n]
        at += n
    return errors, regular


def profile_errors(solution: Solution, errors: FloatArray, problem: Problem) -> None:
    """Put the offsets that raise C by 1 in place of the errors of positions and amplitudes."""
    at = 0
    for k, source in enumerate(solution.sources):
        for j, column in enumerate((X, Y, AMPLITUDE)):
            errors[k, j] = profile_error(solution, k, column, at + j, float(errors[k, j]), problem)
        at += 3 if source[IS_EXTENDED] == 0.0 else 4


def flags_of(solution: Solution, regular: bool, problem: Problem) -> IntArray:
    """The flags the fit itself raises."""
    sources, last_extent = solution.sources, len(problem.table) - 2
    common = (0 if solution.converged else NOT_CONVERGED) + (0 if regular else ERRORS_UNSURE)
    flags = np.full(len(sources), common, np.int32)
    for k, source in enumerate(sources.tolist()):
        x, y = source[X], source[Y]
        if x <= source[X_LOW] or x >= source[X_HIGH] or y <= source[Y_LOW] or y >= source[Y_HIGH]:
            flags[k] |= AT_BOUND
        if source[IS_EXTENDED] != 0.0 and source[EXTENT] >= last_extent:
            flags[k] |= EXTENT_AT_MAX
        if source[IS_SPLIT] != 0.0:
            flags[k] |= SPLIT
    return flags


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
    if n_left < len(sources):
        np.bitwise_or(measured.flags, np.int32(NEIGHBOUR_DROPPED), out=measured.flags)
    for source, level in zip(measured.sources, measured.background, strict=True):
        add_model(images, source, table, NEGLIGIBLE_SHARE * level)
    return measured


def measure(
    images: Images, solution: Solution, problem: Problem, group: int, known: FloatArray | None = None
) -> Fitted:
    """The sources of a fit that pay and lie on observed pixels, with all that is known of them."""
    solution, fall, extent_fall = judged(solution, problem, known)
    n = len(solution.sources)
    if not n:
        return nothing()
    fall = likelihood_falls(solution, fall, problem)
    errors, regular = fisher_errors(solution)
    if regular and problem.limits.profile_errors:
        profile_errors(solution, errors, problem)
    flags = flags_of(solution, regular, problem)
    cut_pix = problem.limits.cut_pix
    share = np.array([observed_share(images.exposure, source, problem.table, cut_pix) for source in solution.sources])
    flags[share < FULLY_OBSERVED] |= PARTLY_OBSERVED
    place = np.floor(solution.sources[:, : Y + 1] + 0.5).astype(np.int64)
    column, row = place[:, X], place[:, Y]
    seen = images.exposure[row, column] > 0.0
    number, together = np.full(n, group, np.int32), np.full(n, n, np.int32)
    level = images.background[row, column]
    found = Fitted(solution.sources, errors, fall, extent_fall, flags, number, together, level, share)
    return found if seen.all() else found.chosen(seen)


def with_late_extents(images: Images, fitted: Fitted, table: FloatArray, limits: Limits) -> Fitted:
    """Extents of the sources of the finished model, each against all others; the background changes with them."""
    rows = [fitted.chosen(slice(k, k + 1)) for k in range(len(fitted.sources))]
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


def fit_candidates(images: Images, candidates: FloatArray, table: FloatArray, limits: Limits) -> Fitted:
    """Accepted sources of all candidates; their models are added to `images.background`.

    candidates: (m, 3) x, y and counts at full exposure, brightest first. table: `PsfTable.cubics`.
    """
    places = np.clip(candidates[:, :2], 0.0, [limits.width - 1.0, limits.height - 1.0])
    waiting = np.ones(len(candidates), np.bool_)
    room = np.empty(limits.n_max_fit, np.int64)
    groups: list[Fitted] = []
    for first in range(len(candidates)):
        if waiting[first]:
            members = room[: take_neighbours(places, waiting, first, limits.group_pix, room)]
            sources = np.zeros((len(members), N_SOURCE_COLUMNS))
            sources[:, : Y + 1], sources[:, AMPLITUDE] = places[members], candidates[members, 2]
            sources[:, CANDIDATE] = members
            set_bounds(sources, limits)
            groups.append(fit_group(images, sources, table, limits, len(groups) + 1))
    fitted = joined(groups)
    return with_late_extents(images, fitted, table, limits) if limits.fit_extent and not limits.two_stage else fitted


def joined(parts: list[Fitted]) -> Fitted:
    """All sources of several fits."""
    parts = [nothing(), *parts]
    return Fitted(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Fitted)))
