"""A smooth positive rate through cells of few counts: penalised cubic splines, Poisson likelihood.

Idea     ln(rate) is a tensor product of uniform cubic B-splines, with a penalty on second differences of the
         coefficients; counts are Poisson with mean rate × exposure. The likelihood of straight lines is not penalised,
         so the fitted counts add up to the observed ones. The penalty's strength is the one that makes the
         coefficients' roughness as likely as the data.
Source   Eilers & Marx 1996 (Stat. Sci. 11, 89); Currie, Durban & Eilers 2006 (J. R. Stat. Soc. B 68, 259) for the
         tensor product; Wood & Fasiolo 2017 (Biometrics 73, 1071) for the strength.
Limits   a cell stands for its centre. Structure narrower than two knots is smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.types import FloatArray, FloatImage

DEGREE = 3
MOST_ITERATIONS = 20
LARGEST_STEP = 2.0  # in ln(rate), keeps the exponential at hand
SETTLED = 2e-3  # largest change of ln(rate), below photon noise; Newton's steps square the error
FIRST_STRENGTH = 10.0  # of the mean curvature of the likelihood: hardly more than a plane
STRENGTH_RANGE = (1e-6, 1e6)  # relative to the first
SLOPE_PRIOR = 3.0  # standard deviation of ln(rate) from side to side; matters for a handful of photons only


@dataclass(frozen=True, slots=True)
class LogSpline:
    """ln(rate) = Σ c[j, i] B_j(y) B_i(x); coordinates run from 0 to 1 over the image. strength: of the penalty."""

    coefficients: FloatImage
    strength: float

    def rate(self, y: FloatArray, x: FloatArray) -> FloatImage:
        """(len(y), len(x)) rates on a grid, in single precision: the exponential of a whole image is slow."""
        n_y, n_x = (n - DEGREE for n in self.coefficients.shape)
        along_y = np.asarray(basis(y, n_y) @ self.coefficients, dtype=np.float32)
        return np.exp(along_y @ np.asarray(basis(x, n_x).T, dtype=np.float32)).astype(np.float64)


def basis(place: FloatArray, n_intervals: int) -> FloatArray:
    """(len(place), n_intervals + 3) uniform cubic B-splines at places in 0 … 1."""
    at = np.clip(np.asarray(place) * n_intervals, 0.0, n_intervals)
    first = np.minimum(at.astype(np.int64), n_intervals - 1)
    u = at - first
    pieces = ((1 - u) ** 3, 4 - 6 * u**2 + 3 * u**3, 1 + 3 * u + 3 * u**2 - 3 * u**3, u**3)
    values = np.zeros((len(at), n_intervals + DEGREE))
    for k, piece in enumerate(pieces):
        values[np.arange(len(at)), first + k] = piece / 6
    return values


@bounded_cache(16)
def difference_penalty(shape: tuple[int, int], order: int) -> FloatImage:
    """Sum of squared differences of the coefficients along both axes, as a quadratic form; read-only."""
    along = [np.diff(np.eye(n), order, axis=0) for n in shape]
    square_y, square_x = (d.T @ d for d in along)
    penalty = np.kron(square_y, np.eye(shape[1])) + np.kron(np.eye(shape[0]), square_x)
    penalty.setflags(write=False)
    return penalty


def curvature(weight: FloatImage, basis_y: FloatArray, basis_x: FloatArray) -> FloatImage:
    """Xᵀ W X of the tensor product without forming it."""
    rows_y = (basis_y[:, :, None] * basis_y[:, None, :]).reshape(len(basis_y), -1)
    rows_x = (basis_x[:, :, None] * basis_x[:, None, :]).reshape(len(basis_x), -1)
    n_y, n_x = basis_y.shape[1], basis_x.shape[1]
    mixed = (rows_y.T @ weight @ rows_x).reshape(n_y, n_y, n_x, n_x)
    return np.ascontiguousarray(mixed.transpose(0, 2, 1, 3)).reshape(n_y * n_x, n_y * n_x)


def fit(
    counts: FloatImage, exposure: FloatImage, n_intervals: tuple[int, int], start: LogSpline | None = None
) -> LogSpline:
    """The rate through equal cells that tile the image.

    counts, exposure: (n_y, n_x) of the cells; exposure 0 = nothing known. Some counts must be positive.
    n_intervals: of the splines along y and x. start: a fit to nearly the same cells.
    """
    from scipy.linalg import cho_factor, cho_solve  # a driver does without

    places = [(np.arange(n) + 0.5) / n for n in counts.shape]
    basis_y, basis_x = basis(places[0], n_intervals[0]), basis(places[1], n_intervals[1])
    shape = (basis_y.shape[1], basis_x.shape[1])
    rough = difference_penalty(shape, 2)
    rank = rough.shape[0] - 4  # straight lines along both axes are free
    slope = difference_penalty(shape, 1) * (max(n_intervals) / (SLOPE_PRIOR**2 * max(shape)))
    coefficients = np.full(shape, np.log(counts.sum() / exposure.sum())) if start is None else start.coefficients
    log_rate = basis_y @ coefficients @ basis_x.T
    strength, first = 0.0 if start is None else start.strength, 0.0
    for _ in range(MOST_ITERATIONS):
        expected = exposure * np.exp(log_rate)
        likelihood = curvature(expected, basis_y, basis_x)
        if first == 0.0:
            first = FIRST_STRENGTH * np.trace(likelihood) / np.trace(rough)
            strength = strength or first
        factor = cho_factor(likelihood + slope + strength * rough, lower=True, check_finite=False)
        score = (basis_y.T @ (counts - expected) @ basis_x).ravel() + likelihood @ coefficients.ravel()
        wanted = cho_solve(factor, score, check_finite=False).reshape(shape)
        change = basis_y @ (wanted - coefficients) @ basis_x.T
        largest = np.abs(change).max()
        share = min(1.0, LARGEST_STEP / largest) if largest > 0.0 else 1.0
        coefficients = coefficients + share * (wanted - coefficients)
        log_rate = log_rate + share * change
        roughness = float(coefficients.ravel() @ rough @ coefficients.ravel())
        freedom = rank - strength * np.trace(cho_solve(factor, rough, check_finite=False))
        low, high = (first * limit for limit in STRENGTH_RANGE)
        strength = min(max(freedom / max(roughness, freedom / high), low), high)
        if largest < SETTLED:
            break
    return LogSpline(coefficients, strength)
