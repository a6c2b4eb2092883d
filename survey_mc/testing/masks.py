"""Claims about unobserved pixels and borders: nothing is found there, and they make nothing up.

Idea     the same photons with and without a mask: what a mask adds along its edges is an artefact. A procedure with
         many false detections is judged by their excess, not by their number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from survey_mc.testing import fields
from survey_mc.testing.case import Case, nearest, pixels_of
from survey_mc.testing.claim import claims_of, expect
from survey_mc.types import BoolArray, FloatImage

if TYPE_CHECKING:
    from pandas import DataFrame

NEAR_EDGE_PIX = 4
BORDER_PIX = 6


def mask_makes_no_sources(case: Case) -> None:
    """On a blank field a mask adds no detections: none in it, no excess along its edges or elsewhere."""
    share = masked_share()
    whole = case.blank("blank", background_per_pix=fields.DEEP_BACKGROUND_PER_PIX)
    photons = fields.photons_of(whole)
    x, y = np.rint(photons).astype(np.int64).T
    granted = None if whole.background is None else whole.background * share
    masked = fields.observe(photons[share[y, x] > 0.0], fields.EXPOSURE_S * share, granted)
    rows, control = case.find(masked), case.find(whole)
    _expect_observed(rows, share > 0.0)
    near = ndimage.binary_dilation(share == 0.0, iterations=NEAR_EDGE_PIX) & (share > 0.0)
    for where, words in ((near, f"within {NEAR_EDGE_PIX} pixels of a mask"), (share > 0.0, "in the observed part")):
        _expect_no_excess(case, _number_in(rows, where), float(_number_in(control, where)), f"detections {words}")


def masked_share() -> FloatImage:
    """1 in a round field of view with gaps, 0 outside."""
    height, width = fields.SHAPE
    y, x = np.mgrid[:height, :width]
    share = np.where(np.hypot(x - (width - 1) / 2.0, y - (height - 1) / 2.0) <= 0.48 * height, 1.0, 0.0)
    share[70:73, :] = 0.0
    share[:, 170:186] = 0.0
    return share


def border_makes_no_sources(case: Case) -> None:
    """On a blank field the border of the image has no more detections than its share of the area."""
    rows = case.find(case.blank("blank", background_per_pix=fields.DEEP_BACKGROUND_PER_PIX))
    border = np.ones(fields.SHAPE, dtype=bool)
    border[BORDER_PIX:-BORDER_PIX, BORDER_PIX:-BORDER_PIX] = False
    expected = _number_in(rows, ~border) * border.sum() / (~border).sum()
    _expect_no_excess(case, _number_in(rows, border), expected, f"detections within {BORDER_PIX} pixels of the border")


def source_cut_by_a_mask_is_found(case: Case) -> None:
    """A bright source that a mask cuts in half is found, and not inside the mask."""
    share = np.ones(fields.SHAPE)
    share[:, 131:] = 0.0
    place = np.array([[129.0, 100.4]])
    rows = case.find(case.draw("cut", place, 600.0, share=share).observation)
    _expect_observed(rows, share > 0.0)
    expect(len(rows) > 0, "a detection of the source", "none")
    _, distance = nearest(rows, place)
    expect(
        bool(distance[0] <= case.tolerances.edge_pix),
        f"a detection within {case.tolerances.edge_pix:g} pixels",
        f"{distance[0]:.1f} pixels",
    )


def _expect_observed(rows: DataFrame, observed: BoolArray) -> None:
    hidden = len(rows) - _number_in(rows, observed)
    expect(hidden == 0, "no detection on an unobserved pixel", f"{hidden} of {len(rows)}")


def _number_in(rows: DataFrame, where: BoolArray) -> int:
    return int(where[pixels_of(rows, where.shape)].sum())


def _expect_no_excess(case: Case, found: int, expected: float, words: str) -> None:
    allowed = expected + case.tolerances.artefact_rows + case.tolerances.artefact_sigma * np.sqrt(expected)
    expect(found <= allowed, f"at most {allowed:.0f} {words}, where a blank sky has {expected:.0f}", found)


MASK_CLAIMS = claims_of(mask_makes_no_sources, border_makes_no_sources, source_cut_by_a_mask_is_found)
