"""The rule of photons: a detection belongs to the source that gave it most of its photons.

Idea     count the photons in the detection's aperture by source; the largest share is the origin, if it stands out
         of the background. No search radius: fair to extended sources and to shifted centroids.
Source   Liu et al. 2022, A&A 661, A27 (eFEDS simulations).
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


@dataclass(frozen=True, slots=True)
class Origins:
    """What each detection rests on; all (n_detections,), sources by id, -1 for none.

    is_significant: the main source gives enough photons, more than the background explains. main_sep_arcsec: NaN if
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
    """Largest and second largest contributor of each detection; ties go to the nearer source, then the lower id."""
    n_detections = len(detections.det_id)
    separation = separation_arcsec(detections, sources, shares.detection, shares.source, scale_arcsec)
    order = np.lexsort((shares.source, separation, -shares.n_photons, shares.detection))  # NaN separations come last
    detection, source, n_photons = shares.detection[order], shares.source[order], shares.n_photons[order]
    first = np.flatnonzero(np.diff(detection, prepend=-1))
    n_contributors = np.diff(first, append=len(detection))
    second = first[n_contributors > 1] + 1

    main_source, second_source = np.full((2, n_detections), -1, dtype=np.int64)
    n_main, n_second = np.zeros((2, n_detections), dtype=np.int64)
    main_sep = np.full(n_detections, np.nan)
    main_source[detection[first]] = source[first]
    n_main[detection[first]] = n_photons[first]
    main_sep[detection[first]] = separation[order][first]
    second_source[detection[second]] = source[second]
    n_second[detection[second]] = n_photons[second]

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
