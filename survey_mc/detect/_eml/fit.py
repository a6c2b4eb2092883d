"""Maximum-likelihood fit of several sources to the photons of a set of pixels.

Idea     model m = B + Σ A e T(r; ext): A the counts at full exposure, e the relative exposure, T the table of shapes.
         Cash's C = 2 Σ (m − n ln m), counted from the model without sources, is minimised by Fisher scoring with
         Marquardt's damping: g = Σ (n/m − 1) ∂m, F = Σ ∂m ∂m / m, (F + λ diag F) δ = g.
Source   Cash 1979, ApJ 228, 939; Cruddace, Hasinger & Schmitt 1988.
Limits   at most 10 sources; a local minimum near the start. Steps are bounded, so a wrong start costs iterations only.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.types import FloatArray

# Columns of a source: position, counts at full exposure, place on the sequence of extents, bounds of the position,
# number of its candidate, and whether it was split from it.
X, Y, AMPLITUDE, EXTENT, IS_EXTENDED, X_LOW, Y_LOW, X_HIGH, Y_HIGH, CANDIDATE, IS_SPLIT = range(11)
N_SOURCE_COLUMNS = 11
PIX_X, PIX_Y, PIX_COUNTS, PIX_BACKGROUND, PIX_EXPOSURE = range(5)  # rows of the pixels

STEPS_PER_PIX = 8.0  # of the table, see `_eml.psf_table`
LEAST_AMPLITUDE = 1e-4
LEAST_RADIUS_PIX = 1e-9  # stands for 0 in a division; slopes vanish there
LARGEST_SHIFT_PIX = 1.0  # of one iteration
LARGEST_EXTENT_SHIFT = 6.0  # of one iteration, in rows of the table (a factor 1.7)
SMALLEST_FALL = 0.2  # an amplitude falls at most to this share in one iteration
FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-7, 1e8
DAMPING_UP, DAMPING_DOWN = 8.0, 0.1
SINGULAR = 1e-12  # of the diagonal
TOLERANCE = 1e-3  # of C: a thirtieth of a standard deviation at most
MAX_ITERATIONS = 40

# Called from compiled code only: no wrapper for Python, which halves the time to compile.
inner = njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


@inner
def shape_at(table: FloatArray, row: int, radius: float) -> tuple[float, float]:
    """Value and slope (per pixel) of a row of the table at a radius (pixels)."""
    place = radius * STEPS_PER_PIX
    k = min(int(place), table.shape[1] - 1)
    t = place - k
    c0, c1, c2, c3 = table[row, k, 0], table[row, k, 1], table[row, k, 2], table[row, k, 3]
    return c0 + t * (c1 + t * (c2 + t * c3)), (c1 + t * (2.0 * c2 + 3.0 * t * c3)) * STEPS_PER_PIX


@inner
def add_source(sources: FloatArray, k: int, pixels: FloatArray, table: FloatArray, at: int, work: FloatArray) -> None:
    """Fill the derivatives by the parameters of a source in each pixel; add its model to row 0.

    An extended shape lies between two rows of the table.
    """
    x, y, amplitude, extended = sources[k, X], sources[k, Y], sources[k, AMPLITUDE], sources[k, IS_EXTENDED] != 0.0
    row = min(int(sources[k, EXTENT]), table.shape[0] - 3) + 1 if extended else 0
    share = sources[k, EXTENT] + 1.0 - row
    for i in range(pixels.shape[1]):
        dx, dy = pixels[PIX_X, i] - x, pixels[PIX_Y, i] - y
        scale = amplitude * pixels[PIX_EXPOSURE, i]
        radius = math.sqrt(dx * dx + dy * dy)
        value, slope = shape_at(table, row, radius)
        if extended:
            wider, wider_slope = shape_at(table, row + 1, radius)
            work[at + 3, i] = scale * (wider - value)
            value, slope = value + share * (wider - value), slope + share * (wider_slope - slope)
        inward = -scale * slope / max(radius, LEAST_RADIUS_PIX)
        work[at, i], work[at + 1, i], work[at + 2, i] = inward * dx, inward * dy, pixels[PIX_EXPOSURE, i] * value
        work[0, i] += scale * value


@inner
def product(work: FloatArray, row: int, n: int) -> float:
    """Scalar product of row 0 and another; four partial sums, in a fixed order, keep the processor busy."""
    s0 = s1 = s2 = s3 = 0.0
    whole = n // 4 * 4
    for i in range(0, whole, 4):
        s0 += work[0, i] * work[row, i]
        s1 += work[0, i + 1] * work[row, i + 1]
        s2 += work[0, i + 2] * work[row, i + 2]
        s3 += work[0, i + 3] * work[row, i + 3]
    for i in range(whole, n):
        s0 += work[0, i] * work[row, i]
    return (s0 + s1) + (s2 + s3)


@inner
def sums(sources: FloatArray, coupled_pix: float, work: FloatArray, gradient: FloatArray, fisher: FloatArray) -> None:
    """Gradient and lower half of the Fisher matrix from the rows of `work`; row 0 is used up."""
    at, n_pixels = 0, work.shape[1]
    for k in range(sources.shape[0]):
        for a in range(at, at + (3 if sources[k, IS_EXTENDED] == 0.0 else 4)):
            gradient[a] = 0.0
            for i in range(n_pixels):
                gradient[a] += work[3 + a, i] * work[1, i]
                work[0, i] = work[3 + a, i] * work[2, i]
            b = 0
            for j in range(k + 1):
                points = sources[j, IS_EXTENDED] + sources[k, IS_EXTENDED] == 0.0
                apart2 = (sources[j, X] - sources[k, X]) ** 2 + (sources[j, Y] - sources[k, Y]) ** 2
                apart = points and apart2 > coupled_pix**2
                for _ in range(3 if sources[j, IS_EXTENDED] == 0.0 else 4):
                    if b <= a:
                        fisher[a, b] = 0.0 if apart else product(work, 3 + b, n_pixels)
                    b += 1
        at += 3 if sources[k, IS_EXTENDED] == 0.0 else 4


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def cash_and_slopes(
    sources: FloatArray,
    pixels: FloatArray,
    table: FloatArray,
    coupled_pix: float,
    gradient: FloatArray,
    fisher: FloatArray,
) -> float:
    """C relative to the background alone; fills −½ ∂C/∂p and the lower half of the Fisher matrix.

    Points further apart than `coupled_pix` hardly know of each other: their part of the matrix is left 0.
    """
    n_pixels, n_parameters = pixels.shape[1], gradient.size
    work = np.empty((3 + n_parameters, n_pixels))  # added model, residual, weight, derivatives
    for i in range(n_pixels):
        work[0, i] = 0.0
    at = work.shape[0] - n_parameters  # a literal number would compile add_source once more
    for k in range(sources.shape[0]):
        add_source(sources, k, pixels, table, at, work)
        at += 3 if sources[k, IS_EXTENDED] == 0.0 else 4
    excess, logs = 0.0, 0.0
    for i in range(n_pixels):
        background, counts = pixels[PIX_BACKGROUND, i], pixels[PIX_COUNTS, i]
        work[2, i] = 1.0 / (background + work[0, i])
        work[1, i] = counts * work[2, i] - 1.0
        excess += work[0, i]
        if counts > 0.0:
            logs += counts * math.log(1.0 + work[0, i] / background)
    sums(sources, coupled_pix, work, gradient, fisher)
    return 2.0 * (excess - logs)


@inner
def solve_damped(
    fisher: FloatArray,
    gradient: FloatArray,
    free: NDArray[np.bool_],
    damping: float,
    factor: FloatArray,
    step: FloatArray,
) -> bool:
    """Step of the free parameters from (F + λ diag F) δ = g by Cholesky; False if F is not positive there.

    factor: room for the Cholesky factor.
    """
    n = gradient.size
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            if free[a] and free[b]:
                total = fisher[a, b]
            if a == b:
                total = total * (1.0 + damping) if free[a] else 1.0
            for c in range(b):
                total -= factor[a, c] * factor[b, c]
            if a != b:
                factor[a, b] = total / factor[b, b]
            elif total > SINGULAR * fisher[a, a] or not free[a]:
                factor[a, a] = math.sqrt(total)
            else:
                return False
    for a in range(n):
        total = gradient[a] if free[a] else 0.0
        for c in range(a):
            total -= factor[a, c] * step[c]
        step[a] = total / factor[a, a]
    for a in range(n - 1, -1, -1):
        total = step[a]
        for c in range(a + 1, n):
            total -= factor[c, a] * step[c]
        step[a] = total / factor[a, a]
    return True


@inner
def move(sources: FloatArray, step: FloatArray, n_extents: int, trial: FloatArray) -> None:
    """Fill `trial` with the sources after a bounded step, inside their bounds."""
    at = 0
    for k in range(sources.shape[0]):
        for j in range(2):
            shift = min(max(step[at + j], -LARGEST_SHIFT_PIX), LARGEST_SHIFT_PIX)
            trial[k, j] = min(max(sources[k, j] + shift, sources[k, X_LOW + j]), sources[k, X_HIGH + j])
        lowest = max(SMALLEST_FALL * sources[k, AMPLITUDE], LEAST_AMPLITUDE)
        trial[k, AMPLITUDE] = max(sources[k, AMPLITUDE] + step[at + 2], lowest)
        at += 3
        if sources[k, IS_EXTENDED] != 0.0:
            shift = min(max(step[at], -LARGEST_EXTENT_SHIFT), LARGEST_EXTENT_SHIFT)
            trial[k, EXTENT] = min(max(sources[k, EXTENT] + shift, 0.0), n_extents - 1.0)
            at += 1


@inner
def find_free(sources: FloatArray, gradient: FloatArray, n_extents: int, held: int, free: NDArray[np.bool_]) -> None:
    """Which parameters may move: not the `held` one, none that pushes against its bound."""
    at = 0
    for k in range(sources.shape[0]):
        vanishing = sources[k, AMPLITUDE] <= LEAST_AMPLITUDE and gradient[at + 2] <= 0.0
        for j in range(2):
            low = sources[k, j] <= sources[k, X_LOW + j] and gradient[at + j] <= 0.0
            high = sources[k, j] >= sources[k, X_HIGH + j] and gradient[at + j] >= 0.0
            free[at + j] = not (vanishing or low or high)
        free[at + 2] = not vanishing
        at += 3
        if sources[k, IS_EXTENDED] != 0.0:
            low = sources[k, EXTENT] <= 0.0 and gradient[at] <= 0.0
            high = sources[k, EXTENT] >= n_extents - 1.0 and gradient[at] >= 0.0
            free[at] = not (low or high or vanishing)
            at += 1
    if held >= 0:
        free[held] = False


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def fit(
    sources: FloatArray, pixels: FloatArray, table: FloatArray, coupled_pix: float, held: int, fisher: FloatArray
) -> tuple[float, bool]:
    """Minimise C over the sources in place; returns C and whether it converged, and fills the Fisher matrix.

    sources: (n, N_SOURCE_COLUMNS). pixels: (5, n_pixels), exposure and background positive. held: number of a parameter
    that stays, −1 for none. fisher: (n_parameters, n_parameters), lower half filled.
    """
    n, n_sources, n_extents = fisher.shape[0], sources.shape[0], table.shape[0] - 1
    step, factor, free = np.empty(n), np.empty((n, n)), np.empty(n, np.bool_)
    gradient, next_gradient, next_fisher = np.empty(n), np.empty(n), np.empty((n, n))
    trial = np.empty((n_sources, N_SOURCE_COLUMNS))
    for k in range(n_sources):
        for j in range(N_SOURCE_COLUMNS):
            trial[k, j] = sources[k, j]
    cash, damping, converged = math.inf, FIRST_DAMPING / DAMPING_DOWN, False
    for n_done in range(MAX_ITERATIONS):
        trial_cash = cash_and_slopes(trial, pixels, table, coupled_pix, next_gradient, next_fisher)
        if trial_cash <= cash or n_done == 0:
            converged = cash - trial_cash < TOLERANCE and damping < 1.0
            cash, damping = trial_cash, max(damping * DAMPING_DOWN, LEAST_DAMPING)
            for k in range(n_sources):
                for j in range(EXTENT + 1):
                    sources[k, j] = trial[k, j]
            for a in range(n):
                gradient[a] = next_gradient[a]
                for b in range(a + 1):
                    fisher[a, b] = next_fisher[a, b]
        else:
            damping *= DAMPING_UP
        find_free(sources, gradient, n_extents, held, free)
        while not solve_damped(fisher, gradient, free, damping, factor, step) and damping <= LARGEST_DAMPING:
            damping *= DAMPING_UP
        gain = 0.0
        for a in range(n):
            gain += gradient[a] * step[a] if free[a] else 0.0
        converged = converged or gain < TOLERANCE
        if converged or damping > LARGEST_DAMPING:
            break
        move(sources, step, n_extents, trial)
    return cash, converged
