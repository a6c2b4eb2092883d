"""Designed pairs of sources: one column of pairs for each separation, one row for each number of counts.

Idea     the first (left) member of every pair has the same counts, the second runs through a list; both may be point
         sources or clusters (β-model).
Source   paper Sects. 4 and 5: separations 15, 30 and 60″, fixed members of 100 counts, 10 ks. The paper prints the
         counts of the others only in its figures; the lists here are ours.
Limits   each pair is moved as a whole by less than half a pixel, at random, because a source at the same place in its
         pixel in every realisation would measure that place; jitter_arcsec = 0 switches this off.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from survey_mc.errors import BadInput
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams, source_rows
from survey_mc.types import FloatArray, Sky
from survey_mc.units import ARCSEC_PER_ARCMIN, SECONDS_PER_KS

LAYOUT_RADIUS_ARCMIN = 10.0  # the paper analyses this circle only
MemberKind = Literal["point", "extended"]


class PairRowsParams(SkyParams):
    """Rows of pairs at chosen separations."""

    kind: Literal["pair_rows"] = "pair_rows"
    separations_arcsec: tuple[PositiveFloat, ...] = Field(
        (15.0, 30.0, 60.0), min_length=1, description="one column of pairs for each separation, arcsec"
    )
    counts: tuple[PositiveFloat, ...] = Field(
        (20.0, 30.0, 50.0, 100.0, 200.0, 500.0),
        min_length=1,
        description="on-axis counts of the second member, one row of pairs for each",
    )
    fixed_counts: PositiveFloat = Field(100.0, description="on-axis counts of the first member of every pair")
    first: MemberKind = Field("point", description="kind of the first (left) member: point or extended")
    second: MemberKind = Field("point", description="kind of the second (right) member: point or extended")
    core_radius_arcsec: PositiveFloat = Field(30.0, description="core radius of extended members, arcsec")
    beta: float = Field(0.75, ge=0.55, le=2.0, description="β of extended members")
    reference_exposure_ks: PositiveFloat = Field(
        10.0, description="exposure in which the counts are counted; others scale with it"
    )
    pair_spacing_arcmin: float = Field(
        3.0, ge=2.0, le=20.0, description="distance between rows, and between neighbours of different pairs in a row"
    )
    jitter_arcsec: float = Field(
        2.0, ge=0.0, le=30.0, description="each pair is moved by up to this, in x and y; 2 is half an EPIC pixel"
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        x_arcsec, y_arcsec = _layout(self)
        radius_arcmin = float(np.hypot(x_arcsec, y_arcsec).max() / ARCSEC_PER_ARCMIN)
        if radius_arcmin > LAYOUT_RADIUS_ARCMIN:
            raise ValueError(
                f"the pairs must lie within {LAYOUT_RADIUS_ARCMIN:g}′ of the axis: fewer counts or separations, or a "
                f"smaller pair_spacing_arcmin (got {radius_arcmin:.1f}′)"
            )
        return self


def draw(params: PairRowsParams, context: SkyContext) -> Sky:
    """The pairs row by row, the two members of a pair one after the other; group_id is the number of the pair."""
    x_arcsec, y_arcsec = _layout(params)
    n_rows, n_columns = len(params.counts), len(params.separations_arcsec)
    shift = context.rng("jitter").uniform(-1.0, 1.0, (n_rows, n_columns, 1, 2)) * params.jitter_arcsec
    x_arcsec, y_arcsec = x_arcsec + shift[..., 0], y_arcsec + shift[..., 1]
    if max(np.abs(x_arcsec).max(), np.abs(y_arcsec).max()) > context.half_width_arcsec:
        raise BadInput(
            "sky", f"the pairs do not fit an image of {2 * context.half_width_arcsec / ARCSEC_PER_ARCMIN:.1f}′"
        )
    shape = (n_rows, n_columns, 2)
    second_counts = np.array(params.counts)[:, None]
    counts = np.stack(np.broadcast_arrays(np.full((n_rows, n_columns), params.fixed_counts), second_counts), axis=2)
    rate_cps = counts.ravel() / (params.reference_exposure_ks * SECONDS_PER_KS)
    kinds = [params.first, params.second] * (n_rows * n_columns)
    extended = np.array([kind == "extended" for kind in kinds])
    separation = np.broadcast_to(np.array(params.separations_arcsec)[None, :, None], shape)
    sources = source_rows(
        kinds,
        x_arcsec.ravel(),
        y_arcsec.ravel(),
        context.flux_cgs(rate_cps),
        rate_cps,
        core_radius_arcsec=np.where(extended, params.core_radius_arcsec, np.nan),
        beta=np.where(extended, params.beta, np.nan),
        group_id=np.repeat(np.arange(n_rows * n_columns, dtype=np.int32), 2),
        group_sep_arcsec=separation.ravel(),
    )
    return Sky(sources)


def _layout(params: PairRowsParams) -> tuple[FloatArray, FloatArray]:
    """x and y (arcsec) of the members, (rows, columns, 2), centred on the axis."""
    spacing_arcsec = params.pair_spacing_arcmin * ARCSEC_PER_ARCMIN
    separation = np.array(params.separations_arcsec)
    left = np.concatenate([[0.0], np.cumsum(separation[:-1] + spacing_arcsec)])
    left -= (left[-1] + separation[-1]) / 2.0
    rows = (np.arange(len(params.counts)) - (len(params.counts) - 1) / 2.0) * spacing_arcsec
    shape = (len(rows), len(separation), 2)
    x_arcsec = np.broadcast_to(np.stack([left, left + separation], axis=1)[None], shape)
    return x_arcsec, np.broadcast_to(rows[:, None, None], shape)


KIND = SkyKind(
    name="pair_rows",
    about="rows of designed pairs at chosen separations and counts",
    params=PairRowsParams,
    draw=draw,
    tiny=PairRowsParams(separations_arcsec=(30.0,), counts=(50.0, 200.0)),
)
