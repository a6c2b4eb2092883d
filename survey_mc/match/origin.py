"""The rule of photons: a detection belongs to the source whose photons made it.

Idea     count the photons in the detection's aperture by source, and in a ring of equal area around it. A point source
         peaks inside; the light of a cluster, or the wing of a bright star, goes on outside. The origin is the source
         with the largest excess inside; where no excess is above its noise, the one with most photons. It counts if
         it stands out of the background. No search radius: fair to extended sources and to shifted centroids.
Source   Liu et al. 2022, A&A 661, A27 (eFEDS simulations). Differs: they take the most photons, which makes every
         source seen through a bright cluster a second detection of the cluster.
Limits   sources that share photons but are not the largest never match; photons of a folded sky image belong to
         one unlisted source without a position, so detections resting on them are `faint`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import gammainc

from survey_mc.match.apertures import Shares
from survey_mc.match.catalogue import Detections, Sources
from survey_mc.match.links import is_first_of_run, separation_arcsec
from survey_mc.match.outcome import BLEND, DUPLICATE, FAINT, MATCHED, SPURIOUS, Verdicts
from survey_mc.match.params import MatchParams
from survey_mc.types import BoolArray, FloatArray

EXCESS_SIGMA = 2.0  # an excess below this many √(inside + around) may be a fluctuation of what passes by


@dataclass(frozen=True, slots=True)
class Origins:
    """What each detection rests on; all (n_detections,), sources by id, -1 for none.

    is_significant: the main source gives enough photons, more than the background explains. second_source: it gives
    most of the photons that are not the main source's, maybe more than that. main_sep_arcsec: NaN if
    none or without a place. is_blend: the second source gives at least the blend fraction of a significant main one.
    """

    main_source: NDArray[np.int64]
    n_main: NDArray[np.int64]
    second_source: NDArray[np.int64]
    n_second: NDArray[np.int64]
    n_background: NDArray[np.int64]
    main_sep_arcsec: FloatArray
    is_significant: BoolArray
    is_blend: BoolArray


def find_origins(
    shares: Shares, detections: Detections, sources: Sources, params: MatchParams, scale_arcsec: float
) -> Origins:
    """Main and second contributor of each detection; ties go to the nearer source, then the lower id."""
    separation = separation_arcsec(detections, sources, shares.detection, shares.source, scale_arcsec)
    main, second = _strongest(
        shares.detection, shares.source, shares.n_photons, shares.n_around, separation, len(detections.det_id)
    )
    main_source, second_source = (np.append(shares.source, -1)[share] for share in (main, second))
    n_main, n_second = (np.append(shares.n_photons, 0)[share] for share in (main, second))
    main_sep = np.append(separation, np.nan)[main]

    # P(≥ n | B) of a Poisson variable is the regularised lower incomplete gamma function; n = 0 has P = 1
    chance = gammainc(np.maximum(n_main + shares.n_background, 1), shares.background_expected)
    is_significant = (n_main >= params.origin_counts_min) & (chance < params.origin_chance_max)
    is_blend = is_significant & (n_second > 0) & (n_second >= params.blend_fraction * n_main)
    return Origins(
        main_source, n_main, second_source, n_second, shares.n_background, main_sep, is_significant, is_blend
    )


@njit(cache=True)
def _strongest(detection, source, n_photons, n_around, separation, n_detections):  # type: ignore[no-untyped-def]
    """Main and second share of each detection, −1 for none."""
    main, second = np.full(n_detections, -1), np.full(n_detections, -1)
    largest, next_largest = np.full(n_detections, -1), np.full(n_detections, -1)
    for k in range(detection.size):
        d = detection[k]
        if largest[d] < 0 or _precedes(k, largest[d], n_photons, separation, source):
            largest[d], next_largest[d] = k, largest[d]
        elif next_largest[d] < 0 or _precedes(k, next_largest[d], n_photons, separation, source):
            next_largest[d] = k
        excess = n_photons[k] - n_around[k]
        best = main[d] if main[d] >= 0 else k
        behind = n_photons[best] - n_around[best]
        if excess > behind or (excess == behind and _precedes(k, best, n_photons, separation, source)):
            best = k
        main[d] = best
    for d in range(n_detections):
        k = main[d]
        if k < 0:
            continue
        # An excess that may be noise does not tell; then it is the one with most photons.
        if n_photons[k] - n_around[k] <= EXCESS_SIGMA * math.sqrt(n_photons[k] + n_around[k]):
            main[d] = largest[d]
        second[d] = next_largest[d] if largest[d] == main[d] else largest[d]
    return main, second


@njit(cache=True)
def _precedes(a, b, n_photons, separation, source):  # type: ignore[no-untyped-def]
    """Share a comes before share b: more photons, then nearer (no place comes last), then the lower source id."""
    if n_photons[a] != n_photons[b]:
        return n_photons[a] > n_photons[b]
    if separation[a] < separation[b] or (np.isnan(separation[b]) and not np.isnan(separation[a])):
        return True
    if separation[b] < separation[a] or (np.isnan(separation[a]) and not np.isnan(separation[b])):
        return False
    return source[a] < source[b]


def by_origin(origins: Origins, sources: Sources) -> Verdicts:
    """What each detection is, by its photons.

    Of the detections that rest on one listed source, the one with most of its photons is matched (ties: nearer, then
    lower det_id); the others are duplicates. A source below the limit makes a `blend` or a `faint` detection.
    """
    n_detections = len(origins.main_source)
    status = np.full(n_detections, SPURIOUS, dtype=np.int8)
    real = np.flatnonzero(origins.is_significant)
    main = origins.main_source[real]
    status[real] = np.where(sources.is_listed[main], DUPLICATE, np.where(origins.is_blend[real], BLEND, FAINT))
    listed = real[sources.is_listed[main]]
    order = np.lexsort((listed, origins.main_sep_arcsec[listed], -origins.n_main[listed], origins.main_source[listed]))
    ordered = listed[order]
    status[ordered[is_first_of_run(origins.main_source[ordered])]] = MATCHED
    return Verdicts(status, np.where(origins.is_significant, origins.main_source, -1))
