"""Clusters of galaxies: β-models at chosen redshifts.

Idea     one average cluster (L[2-10] = 2.8e44 erg/s, 5 keV) is put at every redshift of a list: its core radius from
         the cosmology, its count rate from the paper's table, interpolated in ln(rate) against ln(z).
Source   paper Sect. 2 and Tab. 2 (rates, β = 0.75, core radius), Sect. 7 (the five redshifts).
Limits   z from 0.6 to 2. The text gives the core radius as 250 h⁻¹ kpc (h = ½: 500 kpc), Tab. 2 is computed with
         250 kpc: `h_reading` chooses, the table by default. Rates are those of the table in any cosmology; fluxes use
         the band's factor, made for a power law, and other instruments see these fluxes. The profile is not truncated.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from survey_mc.errors import BadInput
from survey_mc.sky.cosmology import CosmologyName, angle_arcsec, hubble_constant
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams, source_rows
from survey_mc.types import FloatArray, Sky
from survey_mc.units import ARCSEC_PER_ARCMIN

# Tab. 2: redshift, ct/s in 0.5-2 keV, ct/s in 2-10 keV
TABLE_2 = np.array([
    [0.6, 0.1316, 0.0362],
    [0.7, 0.0963, 0.0253],
    [0.8, 0.0734, 0.0185],
    [0.9, 0.0577, 0.0139],
    [1.0, 0.0465, 0.0107],
    [1.1, 0.0382, 0.0085],
    [1.2, 0.0319, 0.0068],
    [1.3, 0.0270, 0.0055],
    [1.4, 0.0231, 0.0046],
    [1.5, 0.0200, 0.0038],
    [1.6, 0.0175, 0.0032],
    [1.7, 0.0154, 0.0027],
    [1.8, 0.0137, 0.0023],
    [1.9, 0.0122, 0.0020],
    [2.0, 0.0109, 0.0018],
])  # fmt: skip
_COLUMN_OF_BAND = {"soft": 1, "hard": 2}
# Tab. 8: erg/cm²/s of one EPIC ct/s; another instrument sees the same flux at its own rate
EPIC_FLUX_PER_RATE_CGS = {"soft": 6.70e-13, "hard": 3.66e-12}
MAX_THROWS = 20_000

Redshift = Annotated[float, Field(ge=0.6, le=2.0)]


class ClustersParams(SkyParams):
    """β-model clusters at chosen redshifts."""

    kind: Literal["clusters"] = "clusters"
    redshifts: tuple[Redshift, ...] = Field(
        (0.6, 1.0, 1.5, 1.8, 2.0), min_length=1, description="one cluster at each redshift, 0.6 to 2"
    )
    beta: float = Field(0.75, ge=0.55, le=2.0, description="β of the profile")
    core_radius_kpc: PositiveFloat = Field(250.0, description="core radius, kpc, read as h_reading says")
    h_reading: Literal["table2", "text"] = Field(
        "table2", description="table2: core_radius_kpc are kpc; text: they are h⁻¹ kpc with h = H₀/100"
    )
    cosmology: CosmologyName = Field("eds50", description="eds50 (the paper's) or planck18 (flat ΛCDM)")
    rate_factor: PositiveFloat = Field(1.0, description="factor on the table's count rates (luminosity)")
    positions_arcmin: tuple[tuple[float, float], ...] | None = Field(
        None, description="x, y of each cluster from the axis, arcmin; default random"
    )
    radius_arcmin: float = Field(8.0, gt=0.0, le=60.0, description="random positions up to this far from the axis")
    min_separation_arcmin: float = Field(4.0, ge=0.0, le=60.0, description="least distance of random positions")

    @model_validator(mode="after")
    def _one_position_each(self) -> Self:
        if self.positions_arcmin is not None and len(self.positions_arcmin) != len(self.redshifts):
            raise ValueError(
                f"positions_arcmin must have one position for each of the {len(self.redshifts)} redshifts "
                f"(got {len(self.positions_arcmin)})"
            )
        return self


def count_rates(redshifts: FloatArray, band: str) -> FloatArray:
    """On-axis EPIC ct/s of the average cluster; interpolated between the rows of Tab. 2."""
    if band not in _COLUMN_OF_BAND:
        raise BadInput("sky", f"clusters have rates for {' and '.join(_COLUMN_OF_BAND)} only (got band {band!r})")
    ln_rate = np.log(TABLE_2[:, _COLUMN_OF_BAND[band]])
    return np.asarray(np.exp(np.interp(np.log(redshifts), np.log(TABLE_2[:, 0]), ln_rate)))


def rate_share(context: SkyContext) -> float:
    """Count rate of the context's instrument over that of EPIC for the same flux; 1 for EPIC."""
    return float(context.rate_cps(np.array(1.0)) * EPIC_FLUX_PER_RATE_CGS[context.band.name])


def core_radii_arcsec(params: ClustersParams) -> FloatArray:
    """Core radius of each cluster."""
    length_kpc = params.core_radius_kpc
    if params.h_reading == "text":
        length_kpc /= hubble_constant(params.cosmology) / 100.0
    return np.array([angle_arcsec(length_kpc, z, params.cosmology) for z in params.redshifts])


def draw(params: ClustersParams, context: SkyContext) -> Sky:
    """The clusters in the order of their redshifts."""
    redshift = np.array(params.redshifts)
    rate_cps = count_rates(redshift, context.band.name) * params.rate_factor * rate_share(context)
    xy_arcsec = _positions_arcmin(params, context) * ARCSEC_PER_ARCMIN
    if np.abs(xy_arcsec).max() > context.half_width_arcsec:
        raise BadInput(
            "sky",
            f"a cluster is at {np.abs(xy_arcsec).max() / ARCSEC_PER_ARCMIN:.1f}′ in x or y; the image ends at "
            f"{context.half_width_arcsec / ARCSEC_PER_ARCMIN:.1f}′",
        )
    sources = source_rows(
        "extended",
        xy_arcsec[:, 0],
        xy_arcsec[:, 1],
        context.flux_cgs(rate_cps),
        rate_cps,
        core_radius_arcsec=core_radii_arcsec(params),
        beta=params.beta,
        redshift=redshift,
    )
    return Sky(sources)


def _positions_arcmin(params: ClustersParams, context: SkyContext) -> FloatArray:
    """(n, 2): as given, or thrown into the circle one after the other, away from those already there."""
    if params.positions_arcmin is not None:
        return np.array(params.positions_arcmin)
    rng = context.rng("cluster_positions")
    placed: list[FloatArray] = []
    for _ in range(MAX_THROWS):
        xy = rng.uniform(-params.radius_arcmin, params.radius_arcmin, 2)
        is_inside = np.hypot(*xy) <= params.radius_arcmin
        if is_inside and all(np.hypot(*(xy - other)) >= params.min_separation_arcmin for other in placed):
            placed.append(xy)
        if len(placed) == len(params.redshifts):
            return np.array(placed)
    raise BadInput(
        "sky.min_separation_arcmin",
        f"{len(params.redshifts)} clusters {params.min_separation_arcmin:g}′ apart do not fit a circle of "
        f"{params.radius_arcmin:g}′",
    )


KIND = SkyKind(
    name="clusters",
    about="clusters of galaxies (β-models) at chosen redshifts",
    params=ClustersParams,
    draw=draw,
    tiny=ClustersParams(redshifts=(1.0,)),
)
