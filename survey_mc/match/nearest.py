"""The rule of position: a detection belongs to the nearest listed source within a radius.

Idea     the paper's cross-identification, with its outcome named: a source wanted by several detections keeps the
         closest, the others are duplicates; what has no listed source nearby is a blend, faint or spurious.
Source   Valtchanov et al. 2001, Sect. 6.2; a detection without a listed counterpart is the paper's "false" one.
Limits   a chance neighbour counts as a match (see `chance`); a blend whose centroid is off its sources does not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from survey_mc.match.catalogue import Sources
from survey_mc.match.links import Pairs, is_first_of_run
from survey_mc.match.origin import Origins
from survey_mc.match.outcome import BLEND, DUPLICATE, FAINT, MATCHED, SPURIOUS, Verdicts
from survey_mc.match.params import Assignment

UNREACHABLE_ARCSEC = 1e9  # cost of a pair that is no candidate: any number of real pairs is cheaper


def by_position(candidates: Pairs, sources: Sources, origins: Origins, assignment: Assignment) -> Verdicts:
    """What each detection is, by position.

    candidates: pairs within the search radius, listed and unlisted sources, sorted by detection then separation.
    """
    n_detections = len(origins.main_source)
    listed = candidates.where(sources.is_listed[candidates.source])
    wanted = _first_of_each(listed, n_detections)
    chosen = _assign(listed, wanted, n_detections, assignment)
    faint = _first_of_each(candidates.where(~sources.is_listed[candidates.source]), n_detections)
    is_unlisted_image = origins.is_significant & (origins.main_source >= 0)
    is_unlisted_image[is_unlisted_image] = ~sources.has_place[origins.main_source[is_unlisted_image]]

    status = np.full(n_detections, SPURIOUS, dtype=np.int8)
    source = np.full(n_detections, -1, dtype=np.int64)
    for code, applies, whose in (
        (FAINT, is_unlisted_image, origins.main_source),
        (FAINT, faint >= 0, faint),
        (BLEND, origins.is_blend, origins.main_source),
        (DUPLICATE, wanted >= 0, wanted),
        (MATCHED, chosen >= 0, chosen),
    ):  # the later outweighs the earlier
        status[applies] = code
        source[applies] = whose[applies]
    return Verdicts(status, source)


def _first_of_each(pairs: Pairs, n_detections: int) -> NDArray[np.int64]:
    """Nearest source of each detection, -1 where there is none."""
    first = np.full(n_detections, -1, dtype=np.int64)
    first[pairs.detection[::-1]] = pairs.source[::-1]  # what is written last stays
    return first


def _assign(listed: Pairs, wanted: NDArray[np.int64], n_detections: int, assignment: Assignment) -> NDArray[np.int64]:
    """Source of each matched detection, -1 where there is none; no source is given twice."""
    chosen = np.full(n_detections, -1, dtype=np.int64)
    if not len(listed.detection):
        return chosen
    if assignment == "one_to_one":
        detection, source = _cheapest(listed)
        chosen[detection] = source
        return chosen
    is_wanted = wanted[listed.detection] == listed.source
    suitors = listed if assignment == "mutual" else listed.where(is_wanted)
    order = np.lexsort((suitors.detection, suitors.sep_arcsec, suitors.source))
    best = order[is_first_of_run(suitors.source[order])]
    source, detection = suitors.source[best], suitors.detection[best]
    keep = wanted[detection] == source
    chosen[detection[keep]] = source[keep]
    return chosen


def _cheapest(listed: Pairs) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """As many pairs as possible; among those the least sum of separations (Hungarian method)."""
    from scipy.optimize import linear_sum_assignment

    detections, row = np.unique(listed.detection, return_inverse=True)
    sources, column = np.unique(listed.source, return_inverse=True)
    cost = np.full((len(detections), len(sources)), UNREACHABLE_ARCSEC)
    cost[row, column] = listed.sep_arcsec
    rows, columns = linear_sum_assignment(cost)
    real = cost[rows, columns] < UNREACHABLE_ARCSEC
    return detections[rows[real]], sources[columns[real]]
