"""How often detections and sources fall on each other by chance.

Idea     turn the catalogue of detections about the optical axis: whatever still falls on a listed source does so by
         chance. For unclustered sources the closed form is 1 − exp(−π r² n).
Source   closed form: Poisson probability of at least one neighbour; rotated catalogues are common practice in surveys.
Limits   the rotation keeps the radial density (vignetting) but not the clustering; sources beyond the image do not
         exist, so detections that a rotation carries into an empty corner lower the rate.

Two questions with two answers: of the detections, how many have a source nearby by chance (the density of sources
decides); of the sources, how many are claimed by a detection by chance (the density of detections decides). The second
one corrects a completeness. There a detection that truly has a source cannot be taken by another one, so the
catalogue of the unmatched detections is the one to turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame
from survey_mc.match.catalogue import detections_of, sources_of
from survey_mc.match.params import MatchParams
from survey_mc.types import BoolArray, Field, FloatArray
from survey_mc.units import ARCSEC_PER_DEG

if TYPE_CHECKING:
    from pandas import DataFrame

N_ROTATIONS = 8


@dataclass(frozen=True, slots=True)
class ChanceMatches:
    """Numbers to be divided last, summed over rotations.

    n_found of n_tried rotated detections have a listed source in the radius; n_claimed of n_sources listed sources
    are the nearest one, within the radius, of a rotated detection.
    """

    n_found: int
    n_tried: int
    n_claimed: int = 0
    n_sources: int = 0


def chance_probability(density_per_deg2: float | FloatArray, radius_arcsec: float | FloatArray) -> float | FloatArray:
    """Probability of at least one unrelated source within a radius, for unclustered sources."""
    area_deg2 = np.pi * (radius_arcsec / ARCSEC_PER_DEG) ** 2
    return -np.expm1(-area_deg2 * density_per_deg2)


def completeness_without_chance(completeness: FloatArray, chance: float | FloatArray) -> FloatArray:
    """Completeness of true matches when a fraction `chance` of the lost sources is found by chance: (C − p)/(1 − p).

    Never below 0, which noise alone would give where next to nothing is found.
    """
    corrected = np.divide(completeness - chance, 1.0 - np.asarray(chance), dtype=np.float64)
    return np.maximum(corrected, 0.0)


def rotated_claims(
    detections_arcsec: FloatArray, sources_arcsec: FloatArray, radius_arcsec: float, n_rotations: int = N_ROTATIONS
) -> NDArray[np.int64]:
    """Nearest source within the radius of each rotated detection, −1 for none.

    detections_arcsec: (n, 2), sources_arcsec: (m, 2), x and y from the optical axis. Result: (n_rotations, n), for
    equal turns about the axis, never 0°.
    """
    claims = np.full((n_rotations, len(detections_arcsec)), -1, dtype=np.int64)
    if not claims.size or not len(sources_arcsec):
        return claims
    from scipy.spatial import cKDTree

    angle = 2.0 * np.pi * np.arange(1, n_rotations + 1)[:, None] / (n_rotations + 1)
    x, y = detections_arcsec[:, 0], detections_arcsec[:, 1]
    turned = np.stack((x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)), axis=-1)
    reach = np.nextafter(radius_arcsec, np.inf)  # the bound itself is left out, the radius is not
    _, nearest = cKDTree(sources_arcsec).query(turned.reshape(-1, 2), distance_upper_bound=reach)
    nearest = nearest.reshape(claims.shape)
    return np.where(nearest < len(sources_arcsec), nearest, claims)


def count_claims(
    claims: NDArray[np.int64], takes_part: BoolArray, detection_inside: BoolArray, source_inside: BoolArray
) -> ChanceMatches:
    """Count the claims of some detections.

    claims: of `rotated_claims`. takes_part: (n,) the detections turned. detection_inside: (n,), source_inside: (m,)
    what lies in the region; a source near its edge may be claimed from outside.
    """
    n_rotations = len(claims)
    tried = takes_part & detection_inside
    is_claimed = np.zeros((n_rotations, len(source_inside) + 1), dtype=bool)  # the last column takes the −1
    is_claimed[np.arange(n_rotations)[:, None], claims[:, takes_part]] = True
    return ChanceMatches(
        n_found=int(np.count_nonzero(claims[:, tried] >= 0)),
        n_tried=int(tried.sum()) * n_rotations,
        n_claimed=int(np.count_nonzero(is_claimed[:, :-1] & source_inside)),
        n_sources=int(source_inside.sum()) * n_rotations,
    )


def chance_matches(
    field: Field, detections: DataFrame, params: MatchParams, counts_min: float, n_rotations: int = N_ROTATIONS
) -> ChanceMatches:
    """Chance matches of all detections and listed sources inside the region of one field."""
    sources = sources_of(field.truth_rows, params, counts_min)
    found = detections_of(ArrayFrame.of_frame(detections), params)
    grid = field.observation.grid

    def from_axis(x_pix: FloatArray, y_pix: FloatArray) -> FloatArray:
        return np.column_stack((x_pix - grid.axis_pix[0], y_pix - grid.axis_pix[1])) * grid.scale_arcsec

    listed = from_axis(sources.x_pix, sources.y_pix)[sources.is_listed]
    claims = rotated_claims(from_axis(found.x_pix, found.y_pix), listed, params.radius_arcsec, n_rotations)
    everyone = np.ones(len(found.det_id), dtype=bool)
    return count_claims(claims, everyone, found.is_inside, sources.is_inside[sources.is_listed])
