"""How often a detection finds a source by chance.

Idea     turn the catalogue of detections about the optical axis: whatever still falls on a listed source does so by
         chance. For unclustered sources the closed form is 1 − exp(−π r² n).
Source   closed form: Poisson probability of at least one neighbour; rotated catalogues are common practice in surveys.
Limits   the rotation keeps the radial density (vignetting) but not the clustering; sources beyond the image do not
         exist, so detections that a rotation carries into an empty corner lower the rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from survey_mc.match.catalogue import detections_of, sources_of
from survey_mc.match.params import MatchParams
from survey_mc.types import Field, FloatArray
from survey_mc.units import ARCSEC_PER_DEG

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True)
class ChanceMatches:
    """Rotated detections with a listed source in the radius, and rotated detections tried; divide last."""

    n_found: int
    n_tried: int


def chance_probability(density_per_deg2: float | FloatArray, radius_arcsec: float | FloatArray) -> float | FloatArray:
    """Probability of at least one unrelated source within a radius, for unclustered sources."""
    area_deg2 = np.pi * (radius_arcsec / ARCSEC_PER_DEG) ** 2
    return -np.expm1(-area_deg2 * density_per_deg2)


def completeness_without_chance(completeness: FloatArray, chance: float | FloatArray) -> FloatArray:
    """Completeness of true matches when a fraction `chance` of the lost sources is found by chance: (C − p)/(1 − p)."""
    return np.asarray((completeness - chance) / (1.0 - chance), dtype=np.float64)


def chance_matches(
    field: Field, detections: DataFrame, params: MatchParams, counts_min: float, n_rotations: int = 8
) -> ChanceMatches:
    """Chance matches of the detections inside the region, summed over equal rotations (never 0°)."""
    sources = sources_of(field.truth, params, counts_min)
    found = detections_of(detections, params)
    inside = found.is_inside
    n_tried = int(inside.sum()) * n_rotations
    if not n_tried or not sources.is_listed.any():
        return ChanceMatches(0, n_tried)
    grid = field.observation.grid
    tree = cKDTree(np.column_stack((sources.x_pix, sources.y_pix))[sources.is_listed])
    x = found.x_pix[inside] - grid.axis_pix[0]
    y = found.y_pix[inside] - grid.axis_pix[1]
    n_found = 0
    for turn in range(1, n_rotations + 1):
        angle = 2.0 * np.pi * turn / (n_rotations + 1)
        turned = np.column_stack(
            (
                grid.axis_pix[0] + x * np.cos(angle) - y * np.sin(angle),
                grid.axis_pix[1] + x * np.sin(angle) + y * np.cos(angle),
            )
        )
        distance_pix, _ = tree.query(turned)
        n_found += int(np.count_nonzero(distance_pix * grid.scale_arcsec <= params.radius_arcsec))
    return ChanceMatches(n_found, n_tried)
