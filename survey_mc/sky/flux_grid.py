"""Sources of a few fixed fluxes on a grid, without neighbours: detection without confusion.

Idea     the nodes of a square grid inside a circle are dealt out at random, the same number to every flux; the rest of
         the nodes stays empty.
Source   paper Sect. 8 (fluxes from 1e-16 to 1e-13 on a grid "such to avoid close neighbours").
Limits   "isolated" is a matter of the wings: at 2′ a soft source of 1e-13 adds 6 % to the background.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from survey_mc.errors import BadInput
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams, source_rows
from survey_mc.types import FloatArray, Sky
from survey_mc.units import ARCSEC_PER_ARCMIN


class FluxGridParams(SkyParams):
    """Isolated sources of fixed fluxes on a grid."""

    kind: Literal["flux_grid"] = "flux_grid"
    fluxes_cgs: tuple[PositiveFloat, ...] | None = Field(
        None, min_length=1, description="the fluxes, erg/cm²/s; default n_fluxes between flux_min_cgs and flux_max_cgs"
    )
    flux_min_cgs: PositiveFloat = Field(1e-16, description="faintest flux, erg/cm²/s")
    flux_max_cgs: PositiveFloat = Field(1e-13, description="brightest flux, erg/cm²/s")
    n_fluxes: int = Field(13, ge=1, le=200, description="number of fluxes, equally spaced in their logarithm")
    spacing_arcmin: float = Field(2.0, ge=0.5, le=20.0, description="distance between nodes of the grid, arcmin")
    radius_arcmin: float = Field(10.0, gt=0.0, le=60.0, description="nodes up to this far from the axis, arcmin")
    jitter_arcsec: float = Field(
        2.0, ge=0.0, le=30.0, description="each source is moved by up to this, in x and y; 2 is half an EPIC pixel"
    )
    source: Literal["point", "extended"] = Field("point", description="kind of the sources: point or extended")
    core_radius_arcsec: PositiveFloat = Field(30.0, description="core radius of extended sources, arcsec")
    beta: float = Field(0.75, ge=0.55, le=2.0, description="β of extended sources")

    @model_validator(mode="after")
    def _enough_nodes(self) -> Self:
        if self.flux_min_cgs > self.flux_max_cgs:
            raise ValueError(f"flux_min_cgs ({self.flux_min_cgs:g}) must be below flux_max_cgs ({self.flux_max_cgs:g})")
        n_nodes, n_fluxes = len(_nodes_arcsec(self)), len(fluxes(self))
        if n_nodes < n_fluxes:
            raise ValueError(
                f"{n_fluxes} fluxes need as many nodes, and spacing_arcmin and radius_arcmin make {n_nodes}"
            )
        return self


def fluxes(params: FluxGridParams) -> FloatArray:
    """The fluxes of the grid, erg/cm²/s."""
    if params.fluxes_cgs is not None:
        return np.array(params.fluxes_cgs)
    return np.geomspace(params.flux_min_cgs, params.flux_max_cgs, params.n_fluxes)


def draw(params: FluxGridParams, context: SkyContext) -> Sky:
    """An equal number of sources of every flux; group_id is the number of the flux."""
    if params.radius_arcmin * ARCSEC_PER_ARCMIN > context.half_width_arcsec:
        raise BadInput(
            "sky.radius_arcmin",
            f"must be at most {context.half_width_arcsec / ARCSEC_PER_ARCMIN:.2f}, half of the image "
            f"(got {params.radius_arcmin:g})",
        )
    nodes, flux_list = _nodes_arcsec(params), fluxes(params)
    rng = context.rng("grid")
    chosen = rng.permutation(len(nodes))[: len(nodes) // len(flux_list) * len(flux_list)]
    xy_arcsec = nodes[chosen] + rng.uniform(-1.0, 1.0, (len(chosen), 2)) * params.jitter_arcsec
    group_id = np.arange(len(chosen), dtype=np.int32) % np.int32(len(flux_list))
    flux_cgs = flux_list[group_id]
    extended = params.source == "extended"
    sources = source_rows(
        params.source,
        xy_arcsec[:, 0],
        xy_arcsec[:, 1],
        flux_cgs,
        context.rate_cps(flux_cgs),
        core_radius_arcsec=params.core_radius_arcsec if extended else np.nan,
        beta=params.beta if extended else np.nan,
        group_id=group_id,
        group_sep_arcsec=params.spacing_arcmin * ARCSEC_PER_ARCMIN,
    )
    return Sky(sources)


def _nodes_arcsec(params: FluxGridParams) -> FloatArray:
    """(n, 2) nodes inside the circle, the axis in the middle of four of them."""
    n_half = int(params.radius_arcmin / params.spacing_arcmin) + 1
    steps = (np.arange(-n_half, n_half) + 0.5) * params.spacing_arcmin
    x_arcmin, y_arcmin = np.meshgrid(steps, steps)
    inside = np.hypot(x_arcmin, y_arcmin) <= params.radius_arcmin
    return np.stack([x_arcmin[inside], y_arcmin[inside]], axis=1) * ARCSEC_PER_ARCMIN


KIND = SkyKind(
    name="flux_grid",
    about="isolated sources of fixed fluxes on a grid",
    params=FluxGridParams,
    draw=draw,
    tiny=FluxGridParams(n_fluxes=3, radius_arcmin=4.0),
)
