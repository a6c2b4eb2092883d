"""Candidate pairs of detections and sources.

Idea     every pair closer than the link radius, and every pair that shares photons, is kept: another rule or another
         radius can be tried on the stored table without new detections.
Limits   flat sky: separations are measured on the tangent plane of the image.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from survey_mc.columns import LINKS
from survey_mc.match.apertures import Shares
from survey_mc.match.catalogue import Detections, Sources
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

LINK_NAMES = tuple(name for name in LINKS.names if name != "realisation")


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pairs of a detection (row) and a source (id), sorted by detection, separation, source."""

    detection: NDArray[np.int64]
    source: NDArray[np.int64]
    sep_arcsec: FloatArray

    def where(self, keep: NDArray[np.bool_]) -> Pairs:
        return Pairs(self.detection[keep], self.source[keep], self.sep_arcsec[keep])


def separation_arcsec(
    detections: Detections,
    sources: Sources,
    detection: NDArray[np.int64],
    source: NDArray[np.int64],
    scale_arcsec: float,
) -> FloatArray:
    """Separation of each pair; NaN where the source is -1 or has no place."""
    separation = np.full(len(detection), np.nan)
    known = source >= 0
    known[known] = sources.has_place[source[known]]
    d, s = detection[known], source[known]
    separation[known] = scale_arcsec * np.hypot(
        detections.x_pix[d] - sources.x_pix[s], detections.y_pix[d] - sources.y_pix[s]
    )
    return separation


def close_pairs(detections: Detections, sources: Sources, radius_arcsec: float, scale_arcsec: float) -> Pairs:
    """All pairs with a separation up to the radius (inclusive)."""
    placed = np.flatnonzero(sources.has_place)
    if not len(placed) or not len(detections.det_id):
        nothing = np.zeros(0, dtype=np.int64)
        return Pairs(nothing, nothing, np.zeros(0))
    tree = cKDTree(np.column_stack((sources.x_pix[placed], sources.y_pix[placed])), balanced_tree=False)
    found = cKDTree(np.column_stack((detections.x_pix, detections.y_pix))).sparse_distance_matrix(
        tree,
        radius_arcsec / scale_arcsec * (1.0 + 1e-9),  # rounding must not lose a pair at the radius itself
        output_type="ndarray",
    )
    detection, source = found["i"].astype(np.int64), placed[found["j"]].astype(np.int64)
    separation = separation_arcsec(detections, sources, detection, source, scale_arcsec)
    keep = separation <= radius_arcsec
    detection, source, separation = detection[keep], source[keep], separation[keep]
    order = np.lexsort((source, separation, detection))
    return Pairs(detection[order], source[order], separation[order])


def link_frame(
    detections: Detections, sources: Sources, close: Pairs, shares: Shares, photons_min: int, scale_arcsec: float
) -> DataFrame:
    """The links table of one field, without `realisation`: close pairs and pairs sharing at least `photons_min`.

    Sorted by detection, separation and source. n_photons counts the photons of all linked pairs, however few.
    """
    import pandas as pd

    n_sources = max(len(sources.x_pix), 1)
    close_key = close.detection * n_sources + close.source
    share_key = shares.detection * n_sources + shares.source
    key = np.unique(np.concatenate((close_key, share_key[shares.n_photons >= photons_min])))
    detection, source = key // n_sources, key % n_sources
    by_key = np.argsort(share_key)
    n_photons = np.zeros(len(key), dtype=np.int64)
    if len(share_key):
        place = np.minimum(np.searchsorted(share_key[by_key], key), len(share_key) - 1)
        is_shared = share_key[by_key][place] == key
        n_photons[is_shared] = shares.n_photons[by_key][place][is_shared]
    separation = separation_arcsec(detections, sources, detection, source, scale_arcsec)
    order = np.lexsort((source, separation, detection))
    columns = {
        "det_id": detections.det_id[detection][order].astype(np.int32),
        "source_id": source[order].astype(np.int32),
        "sep_arcsec": separation[order],
        "n_photons": n_photons[order].astype(np.int32),
        "in_list": sources.is_listed[source][order] if len(source) else np.zeros(0, dtype=bool),
    }
    return pd.DataFrame({name: columns[name] for name in LINK_NAMES}, copy=False)
