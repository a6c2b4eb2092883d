"""MR/1 multiresolution filter: what is significant in few photons is kept, the rest is smooth sky.

Idea     project the photons on cubic B-splines, mark the wavelet coefficients that n photons in their box would hardly
         give by chance, then restore iteratively an image whose residual has nothing left inside that support.
Source   paper Sect. 3.4; Starck & Pierre 1998 A&AS 128, 397; Slezak et al. 1993; options named as in the MR/1 package.
Limits   a box counts the source's own photons too, so thresholds are conservative near bright peaks. The image border
         is treated alike in the projection and in the transform (MR/1 projects with zeros outside). Pixels that were
         not observed should arrive filled with the expected background, so that their edge is no feature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from survey_mc.detect._mr1 import atrous
from survey_mc.detect._mr1.few_event import coefficient_limits
from survey_mc.detect._mr1.params import PROJECTION, BorderName, Mr1Params, check_scales
from survey_mc.types import FloatImage

BORDERS = {"mirror": atrous.BORDER_MIRROR, "nearest": atrous.BORDER_NEAREST}
KEEP_ALL_LIMITS = np.zeros((1, 1, 1), np.float32)


@dataclass(frozen=True, slots=True)
class Restored:
    """Filtered image (counts per pixel), the support it rests on, iterations done and last change of Σ residual²."""

    image: NDArray[np.float32]
    support: NDArray[np.uint8]
    n_iterations: int
    last_change: float


def project(photons: FloatImage, border: BorderName) -> NDArray[np.float32]:
    """Photons on the cubic-spline space V₀; away from the border the sum is conserved."""
    rows = convolve1d(photons, PROJECTION, axis=0, mode=border)
    return np.ascontiguousarray(convolve1d(rows, PROJECTION, axis=1, mode=border), dtype=np.float32)


def photon_limits(
    photons: FloatImage, scale: int, params: Mr1Params
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lower and upper limit of every coefficient of one wavelet plane (0 = finest)."""
    lower_table, upper_table = coefficient_limits(params.significance, params.min_events)
    lower, upper = np.empty(photons.shape, np.float32), np.empty(photons.shape, np.float32)
    atrous.box_counts_limits(
        photons, 2 ** (scale + 2), BORDERS[params.border], lower_table, upper_table, 0.25**scale, lower, upper
    )
    return lower, upper


def significant(
    projected: NDArray[np.float32], photons: FloatImage, params: Mr1Params
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Support (n_planes, ny, nx) of 0/1, and the |limits| for a growing support (a dummy if it is fixed)."""
    work = atrous.Workspace.of(projected.shape, params.n_scales - 1)
    atrous.transform(projected, work, BORDERS[params.border])
    planes = work.planes
    support = np.zeros(planes.shape, np.uint8)
    limits = np.empty(planes.shape, np.float32) if params.grow_support else KEEP_ALL_LIMITS
    for s in range(params.first_scale - 1, len(planes)):
        lower, upper = photon_limits(photons, s, params)
        marked = planes[s] >= upper
        support[s] = marked if params.positive_only else marked | (planes[s] <= lower)
        if params.grow_support:
            limits[s] = np.maximum(-lower, upper)
    if params.kill_isolated:
        support = atrous.kill_isolated(support)
    return support, limits


def restore(photons: FloatImage, params: Mr1Params) -> Restored:
    """Filter a photon image (float64, C order; fractional where unobserved pixels were filled)."""
    check_scales(params, photons.shape)
    projected = project(photons, params.border)
    support, limits = significant(projected, photons, params)
    return iterate(projected, support, limits, params)


def iterate(
    image: NDArray[np.float32], support: NDArray[np.uint8], limits: NDArray[np.float32], params: Mr1Params
) -> Restored:
    """S ← S + rec(M · w(I − S)) with the support M, until Σ(I − S)² settles."""
    border, first, adjoint = BORDERS[params.border], params.first_scale - 1, params.reconstruction == "adjoint"
    work = atrous.Workspace.of(image.shape, len(support))
    solution, residual = np.zeros_like(image), image.copy()
    energy_before, change, done = float(np.square(image.astype(np.float64)).sum()), np.inf, 0
    while done < params.iterations and abs(change) >= params.tolerance:
        smooth = atrous.transform(residual, work, border, first, None if params.grow_support else support)
        if params.grow_support:
            grow(support, limits, work.planes, params)
        if params.suppress_last_scale:
            smooth[:] = 0.0
        correction = atrous.reconstruct(smooth, work, border, first, adjoint)
        energy = atrous.update_solution(image, correction, params.positive_image, solution, residual)
        change = (energy_before - energy) / image.size
        energy_before, done = energy, done + 1
    return Restored(solution, support, done, change)


def grow(
    support: NDArray[np.uint8], limits: NDArray[np.float32], planes: NDArray[np.float32], params: Mr1Params
) -> None:
    """Add the residual coefficients beyond their limits to the support and drop the others, in place."""
    for s in range(params.first_scale - 1, len(planes)):
        beyond = planes[s] if params.positive_only else np.abs(planes[s])
        support[s] |= beyond > limits[s]
        planes[s] *= support[s]
