"""Candidate pairs of detections and sources.

Idea     every pair closer than the link radius, and every pair that shares photons, is kept: another rule or another
         radius can be tried on the stored table without new detections.
Limits   flat sky: separations are measured on the tangent plane of the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame
from survey_mc.columns import LINKS
from survey_mc.match.apertures import Shares
from survey_mc.match.catalogue import Detections, Sources
from survey_mc.types import BoolArray, FloatArray

ROUNDING = 1e-9  # must not lose a pair at the radius itself
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
    _put_separations(
        detections.x_pix,
        detections.y_pix,
        sources.x_pix,
        sources.y_pix,
        sources.has_place,
        detection,
        source,
        scale_arcsec,
        separation,
    )
    return separation


@njit(cache=True)
def _put_separations(x_detection, y_detection, x_source, y_source, has_place, detection, source, scale_arcsec, out):  # type: ignore[no-untyped-def]
    for k in range(detection.size):
        d, s = detection[k], source[k]
        if s >= 0 and has_place[s]:
            out[k] = scale_arcsec * math.hypot(x_detection[d] - x_source[s], y_detection[d] - y_source[s])


def is_first_of_run(values: NDArray[np.int64]) -> BoolArray:
    """(n,) where a value differs from the one before."""
    is_first = np.ones(len(values), dtype=bool)
    np.not_equal(values[1:], values[:-1], out=is_first[1:])
    return is_first


def close_pairs(detections: Detections, sources: Sources, radius_arcsec: float, scale_arcsec: float) -> Pairs:
    """All pairs with a separation up to the radius (inclusive)."""
    upwards = np.argsort(detections.y_pix)
    place, source = _candidates(
        detections.x_pix[upwards],
        detections.y_pix[upwards],
        sources.x_pix,
        sources.y_pix,
        sources.has_place,
        radius_arcsec / scale_arcsec * (1.0 + ROUNDING),
    )
    detection = upwards[place]
    separation = separation_arcsec(detections, sources, detection, source, scale_arcsec)
    order = np.lexsort((source, separation, detection))
    return Pairs(detection[order], source[order], separation[order]).where(separation[order] <= radius_arcsec)


@njit(cache=True)
def _candidates(x_detection, y_detection, x_source, y_source, has_place, reach_pix):  # type: ignore[no-untyped-def]
    """Pairs (detection, source) within reach. The detections are in order of y: a source sees those in its strip."""
    n_detections = y_detection.size
    pairs = np.empty((2, 4 * n_detections + 16), np.int64)
    first_from_row = _first_from_row(y_detection)
    n = 0
    for s in range(x_source.size):
        row = math.floor(y_source[s] - reach_pix) if has_place[s] else first_from_row.size
        if row >= first_from_row.size:
            continue
        for d in range(first_from_row[max(row, 0)], n_detections):
            dx, dy = x_detection[d] - x_source[s], y_detection[d] - y_source[s]
            if dy > reach_pix:
                break
            if dx * dx + dy * dy <= reach_pix * reach_pix:
                if n == pairs.shape[1]:
                    larger = np.empty((2, 2 * n), np.int64)
                    for k in range(n):  # assigning slices would take seconds to compile
                        larger[0, k], larger[1, k] = pairs[0, k], pairs[1, k]
                    pairs = larger
                pairs[0, n], pairs[1, n] = d, s
                n += 1
    return pairs[0, :n], pairs[1, :n]


@njit(cache=True)
def _first_from_row(y_pix):  # type: ignore[no-untyped-def]
    """The first of ascending positions with y ≥ 1, 2, 3 … in places 1, 2, 3 …, and all of them from place 0."""
    n_rows = 1 + max(0, int(y_pix[-1])) if y_pix.size else 1
    first = np.zeros(n_rows, np.int64)
    k = 0
    for row in range(1, n_rows):
        while y_pix[k] < row:
            k += 1
        first[row] = k
    return first


def link_rows(
    detections: Detections, sources: Sources, close: Pairs, shares: Shares, photons_min: int, scale_arcsec: float
) -> ArrayFrame:
    """The links table of one field, without `realisation`: close pairs and pairs sharing at least `photons_min`.

    Sorted by detection, separation and source. n_photons counts the photons of all linked pairs, however few.
    """
    linked = np.empty((3, len(close.detection) + len(shares.detection)), dtype=np.int64)
    n_linked = _put_linked(
        close.detection, close.source, shares.detection, shares.source, shares.n_photons, photons_min, linked
    )
    detection, source, n_photons = linked[:, :n_linked]
    separation = separation_arcsec(detections, sources, detection, source, scale_arcsec)
    order = np.lexsort((source, separation, detection))
    columns = {
        "det_id": detections.det_id[detection[order]],
        "source_id": source[order].astype(np.int32),
        "sep_arcsec": separation[order],
        "n_photons": n_photons[order].astype(np.int32),
        "in_list": sources.is_listed[source[order]],
    }
    return ArrayFrame({name: columns[name] for name in LINK_NAMES})


@njit(cache=True)
def _put_linked(close_detection, close_source, share_detection, share_source, n_photons, photons_min, out):  # type: ignore[no-untyped-def]
    """Put (detection, source, photons) of the close pairs, then of the others that share enough, into columns of `out`.

    Both kinds of pairs come in order of detection. Returns how many were put.
    """
    is_close = np.zeros(share_detection.size, np.bool_)
    n = first = 0
    for k in range(close_detection.size):
        while first < share_detection.size and share_detection[first] < close_detection[k]:
            first += 1
        photons = 0
        for i in range(first, share_detection.size):
            if share_detection[i] != close_detection[k]:
                break
            if share_source[i] == close_source[k]:
                is_close[i] = True
                photons = n_photons[i]
        out[0, n], out[1, n], out[2, n] = close_detection[k], close_source[k], photons
        n += 1
    for i in range(share_detection.size):
        if not is_close[i] and n_photons[i] >= photons_min:
            out[0, n], out[1, n], out[2, n] = share_detection[i], share_source[i], n_photons[i]
            n += 1
    return n
