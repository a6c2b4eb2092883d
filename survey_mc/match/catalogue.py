"""The columns of one field that matching works on, as plain arrays.

Idea     take what is needed out of the frames once; the rules then speak of row numbers: a detection is its row in
         det_id order, a source its source_id.
Limits   a source with `kind` "image" has photons but no position: it is never listed and never linked by position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.match.params import MatchParams
from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame


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

    det_id: NDArray[np.int64]
    x_pix: FloatArray
    y_pix: FloatArray
    r50_arcsec: FloatArray
    is_inside: BoolArray


def sources_of(truth: DataFrame, params: MatchParams, counts_min: float) -> Sources:
    """Truth in arrays; sources of at least `counts_min` counts are listed."""
    x_pix = truth["x_pix"].to_numpy(np.float64)
    y_pix = truth["y_pix"].to_numpy(np.float64)
    is_image = np.asarray(truth["kind"].array == "image", dtype=bool)
    has_place = ~is_image & np.isfinite(x_pix) & np.isfinite(y_pix)
    is_listed = has_place & (truth[params.counts_min_on].to_numpy(np.float64) >= counts_min)
    is_inside = truth["offaxis_arcmin"].to_numpy(np.float64) <= params.region_arcmin
    return Sources(x_pix, y_pix, has_place, is_listed, is_inside)


def detections_of(detections: DataFrame, params: MatchParams) -> Detections:
    """Detections in arrays; the frame must be in the order of det_id."""
    return Detections(
        detections["det_id"].to_numpy(np.int64),
        detections["x_pix"].to_numpy(np.float64),
        detections["y_pix"].to_numpy(np.float64),
        detections["r50_arcsec"].to_numpy(np.float64),
        detections["offaxis_arcmin"].to_numpy(np.float64) <= params.region_arcmin,
    )
