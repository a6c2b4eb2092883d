"""The columns of one field that matching works on, as plain arrays.

Idea     take what is needed out of the frames once; the rules then speak of row numbers: a detection is its row in
         det_id order, a source its source_id.
Limits   a source with `kind` "image" has photons but no position: it is never listed and never linked by position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame
from survey_mc.match.params import MatchParams
from survey_mc.types import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Sources:
    """True sources by source_id. is_listed: in the input list; is_inside: in the region; has_place: has a position."""

    x_pix: FloatArray
    y_pix: FloatArray
    has_place: BoolArray
    is_listed: BoolArray
    is_inside: BoolArray


@dataclass(frozen=True, slots=True)
class Detections:
    """Detections in the order of det_id."""

    det_id: NDArray[np.int32]
    x_pix: FloatArray
    y_pix: FloatArray
    r50_arcsec: FloatArray
    is_inside: BoolArray


def sources_of(truth: ArrayFrame, params: MatchParams, counts_min: float) -> Sources:
    """Truth in arrays; sources of at least `counts_min` counts are listed."""
    x_pix, y_pix = truth["x_pix"], truth["y_pix"]
    has_place = ~truth.texts("kind").are("image") & np.isfinite(x_pix) & np.isfinite(y_pix)
    is_listed = has_place & (truth[params.counts_min_on] >= counts_min)
    is_inside = truth["offaxis_arcmin"] <= params.region_arcmin
    return Sources(x_pix, y_pix, has_place, is_listed, is_inside)


def detections_of(detections: ArrayFrame, params: MatchParams) -> Detections:
    """Detections in arrays; the rows must be in the order of det_id."""
    return Detections(
        detections["det_id"],
        detections["x_pix"],
        detections["y_pix"],
        detections["r50_arcsec"],
        detections["offaxis_arcmin"] <= params.region_arcmin,
    )
