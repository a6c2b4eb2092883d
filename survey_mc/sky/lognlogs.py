"""Random point sources whose fluxes follow a published logN-logS.

Idea     a Poisson process in flux, built from its arrival levels: with Γ₁ < Γ₂ < … the arrivals of a unit Poisson
         process, S_i = N⁻¹(Γ_i / area) are the fluxes of a Poisson sky from bright to faint, down to any limit.
         Source i takes the i-th pair of the positions stream. So bands share positions and rank, and a lower
         flux_min adds faint sources without moving one of the bright.
Source   paper Sects. 5-8 (fields of random AGN); inverse-measure construction of a Poisson process, e.g. Kingman 1993.
Limits   no clustering; the background of the instrument already holds unresolved sources, so that a deep flux_min
         counts the faintest twice (16 % of the soft background between 1e-16 and 6e-16 with hasinger1998).
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from survey_mc.errors import BadInput
from survey_mc.sky.counts import FLUX_BRIGHTEST_CGS, FLUX_FAINTEST_CGS, Counts
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams, source_rows
from survey_mc.sky.relations import RELATIONS, number_counts, relations_for
from survey_mc.types import FloatArray, Sky
from survey_mc.units import ARCSEC_PER_ARCMIN, ARCSEC_PER_DEG


class BandModels(BaseModel):
    """The relation of each band."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    soft: str | None = Field("hasinger1998", description="relation of the soft band")
    hard: str | None = Field("giacconi2001", description="relation of the hard band")

    @field_validator("soft", "hard")
    @classmethod
    def _known(cls, name: str | None, info: object) -> str | None:
        band = str(getattr(info, "field_name", ""))
        if name is not None and (name not in RELATIONS or band not in RELATIONS[name].counts):
            raise ValueError(f"{name!r} is no relation of the {band} band; known: {', '.join(relations_for(band))}")
        return name


class LogNLogSParams(SkyParams):
    """Random point sources of a logN-logS."""

    kind: Literal["lognlogs"] = "lognlogs"
    model: BandModels = Field(
        BandModels(),
        description="relation of each band, { soft = …, hard = … }, or one name for the bands it is known in",
    )
    flux_min_cgs: float = Field(
        1e-16, ge=FLUX_FAINTEST_CGS, le=FLUX_BRIGHTEST_CGS, description="faintest flux drawn, erg/cm²/s"
    )
    flux_max_cgs: float = Field(
        1e-12,
        ge=FLUX_FAINTEST_CGS,
        le=FLUX_BRIGHTEST_CGS,
        description="brightest flux drawn, erg/cm²/s. Fewer than 2 % of EPIC fields hold a serendipitous source above "
        "1e-12, surveys avoid them, and the photons of one would swamp the field",
    )
    margin_arcmin: float = Field(
        1.0, ge=1.0, le=30.0, description="sources are drawn this far beyond the image, for the wings of the PSF"
    )
    normalisation: float = Field(1.0, gt=0.0, le=100.0, description="factor on the number of sources")
    layout: Literal["random"] = Field("random", description="positions: uniform and independent")

    @field_validator("model", mode="before")
    @classmethod
    def _one_name_for_its_bands(cls, model: object) -> object:
        if not isinstance(model, str):
            return model
        if model not in RELATIONS:
            raise ValueError(f"unknown relation {model!r}; known: {', '.join(RELATIONS.names)}")
        return {band: model if band in RELATIONS[model].counts else None for band in ("soft", "hard")}

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.flux_min_cgs >= self.flux_max_cgs:
            raise ValueError(f"flux_min_cgs ({self.flux_min_cgs:g}) must be below flux_max_cgs ({self.flux_max_cgs:g})")
        return self


def draw(params: LogNLogSParams, context: SkyContext) -> Sky:
    """Point sources, bright to faint, uniform in the square of the image and its margin."""
    half_arcsec = _half_side_arcsec(params, context.half_width_arcsec)
    counts = _counts_of_band(params, context.band.name)
    flux_cgs = poisson_fluxes(
        counts,
        _area_deg2(half_arcsec) * params.normalisation,
        params.flux_min_cgs,
        params.flux_max_cgs,
        context.rng("levels"),
    )
    unit_square = context.rng("positions").random((len(flux_cgs), 2))
    x_arcsec, y_arcsec = (2.0 * unit_square.T - 1.0) * half_arcsec
    return Sky(source_rows("point", x_arcsec, y_arcsec, flux_cgs, context.rate_cps(flux_cgs)))


def expected_number(params: LogNLogSParams, band: str, half_width_arcsec: float) -> float:
    """Mean number of sources that `draw` gives on an image of this half width."""
    limits_cgs = np.array([params.flux_min_cgs, params.flux_max_cgs])
    faint, bright = _counts_of_band(params, band).number_above(limits_cgs)
    return float(faint - bright) * params.normalisation * _area_deg2(_half_side_arcsec(params, half_width_arcsec))


def _half_side_arcsec(params: LogNLogSParams, half_width_arcsec: float) -> float:
    return half_width_arcsec + params.margin_arcmin * ARCSEC_PER_ARCMIN


def _area_deg2(half_arcsec: float) -> float:
    return (2 * half_arcsec / ARCSEC_PER_DEG) ** 2


def poisson_fluxes(
    counts: Counts, area_deg2: float, flux_min_cgs: float, flux_max_cgs: float, rng: np.random.Generator
) -> FloatArray:
    """Fluxes of a Poisson sky of this area, bright to faint, between the two limits.

    A smaller flux_min gives the same bright sources followed by fainter ones.
    """
    first, last = area_deg2 * counts.number_above(np.array([flux_max_cgs, flux_min_cgs]))
    levels = _arrivals_between(float(first), float(last), rng)
    return counts.flux_at(levels / area_deg2)


def _arrivals_between(first: float, last: float, rng: np.random.Generator) -> FloatArray:
    """Arrivals of a unit Poisson process that starts at `first`, those below `last`.

    Drawn in pieces whose size does not matter: a running sum is added up in the same order whatever the pieces.
    """
    pieces: list[FloatArray] = []
    level = first
    while level < last:
        missing = last - level
        gaps = rng.standard_exponential(int(missing + 5.0 * np.sqrt(missing)) + 16)
        gaps[0] += level
        arrivals = np.cumsum(gaps)
        level = float(arrivals[-1])
        pieces.append(arrivals)
    levels = np.concatenate(pieces) if pieces else np.empty(0)
    return levels[: np.searchsorted(levels, last)]


def _counts_of_band(params: LogNLogSParams, band: str) -> Counts:
    name = getattr(params.model, band, None)
    if name is None:
        known = ", ".join(relations_for(band)) or "none"
        raise BadInput("sky.model", f"no relation is given for the {band} band; known for {band}: {known}")
    return number_counts(name, band)


KIND = SkyKind(
    name="lognlogs",
    about="random point sources whose fluxes follow a published logN-logS",
    params=LogNLogSParams,
    draw=draw,
    tiny=LogNLogSParams(flux_min_cgs=3e-15),
)
