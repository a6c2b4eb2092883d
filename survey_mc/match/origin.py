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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc

from survey_mc.match.apertures import Shares
from survey_mc.match.catalogue import Detections, Sources
from survey_mc.match.links import separation_arcsec
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
    n_detections = len(detections.det_id)
    separation = separation_arcsec(detections, sources, shares.detection, shares.source, scale_arcsec)
    excess = shares.n_photons - shares.n_around
    stands_out = excess > EXCESS_SIGMA * np.sqrt(shares.n_photons + shares.n_around)
    ties = (shares.source, separation)  # NaN separations come last
    by_photons = np.lexsort((*ties, -shares.n_photons, shares.detection))
    by_excess = np.lexsort((*ties, -shares.n_photons, -excess, shares.detection))
    first = np.flatnonzero(np.diff(shares.detection[by_photons], prepend=-1))
    main = np.where(stands_out[by_excess[first]], by_excess[first], by_photons[first])
    several = np.diff(first, append=len(by_photons)) > 1
    largest, next_largest = by_photons[first[several]], by_photons[first[several] + 1]
    second = np.where(largest == main[several], next_largest, largest)

    main_source, second_source = np.full((2, n_detections), -1, dtype=np.int64)
    n_main, n_second = np.zeros((2, n_detections), dtype=np.int64)
    main_sep = np.full(n_detections, np.nan)
    main_source[shares.detection[main]] = shares.source[main]
    n_main[shares.detection[main]] = shares.n_photons[main]
    main_sep[shares.detection[main]] = separation[main]
    second_source[shares.detection[second]] = shares.source[second]
    n_second[shares.detection[second]] = shares.n_photons[second]

    # P(≥ n | B) of a Poisson variable is the regularised lower incomplete gamma function; n = 0 has P = 1
    chance = gammainc(np.maximum(n_main + shares.n_background, 1), shares.background_expected)
    is_significant = (n_main >= params.origin_counts_min) & (chance < params.origin_chance_max)
    is_blend = is_significant & (n_second > 0) & (n_second >= params.blend_fraction * n_main)
    return Origins(
        main_source, n_main, second_source, n_second, shares.n_background, main_sep, is_significant, is_blend
    )


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
    _, place = np.unique(origins.main_source[listed][order], return_index=True)
    status[listed[order][place]] = MATCHED
    return Verdicts(status, np.where(origins.is_significant, origins.main_source, -1))
