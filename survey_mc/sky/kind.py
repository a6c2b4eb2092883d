"""What a kind of sky is: a record of a parameter model and a function that draws the sources.

Idea     a kind turns its parameters and a context (band, size of the field, named random streams) into a `Sky`;
         it knows no telescope and opens no file.
Limits   flat sky; positions are offsets from the optical axis in arcsec. One spectrum, hence one flux per rate, a band.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from survey_mc.array_frame import ArrayFrame, Texts
from survey_mc.errors import BadInput
from survey_mc.types import Band, FloatArray, IntArray, Sky, SkyImage
from survey_mc.units import flux_from_rate, rate_from_flux


class SkyParams(BaseModel):
    """Base of every sky's parameters: frozen, unknown keys refused, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: str


@dataclass(frozen=True, slots=True)
class SkyContext:
    """What a sky may depend on besides its parameters.

    half_width_arcsec: half of the side of the image. rng(name): the stream `name` of this realisation; bands and
    exposures of a realisation get the same streams. images: the opened sky images, by the path a campaign gives.
    """

    band: Band
    half_width_arcsec: float
    rng: Callable[[str], np.random.Generator]
    images: Mapping[str, SkyImage]

    def with_streams_of(self, part: str) -> SkyContext:
        """The same context with other, independent streams."""
        rng = self.rng
        return replace(self, rng=lambda name: rng(f"{part}/{name}"))

    def rate_cps(self, flux_cgs: FloatArray) -> FloatArray:
        """On-axis count rate of fluxes in this band."""
        return np.asarray(rate_from_flux(flux_cgs, self._flux_per_rate_cgs()), dtype=np.float64)

    def flux_cgs(self, rate_cps: FloatArray) -> FloatArray:
        """Flux of on-axis count rates in this band."""
        return np.asarray(flux_from_rate(rate_cps, self._flux_per_rate_cgs()), dtype=np.float64)

    def _flux_per_rate_cgs(self) -> float:
        if self.band.flux_per_rate_cgs is None:
            raise BadInput(
                "sky", f"band {self.band.name!r} has no flux per count rate; give instrument.flux_per_rate_cgs"
            )
        return self.band.flux_per_rate_cgs


@dataclass(frozen=True, slots=True)
class SkyKind:
    """A registered kind of sky. tiny: parameters for quick contract tests."""

    name: str
    about: str
    params: type[SkyParams]
    draw: Callable[[Any, SkyContext], Sky]
    tiny: SkyParams


def source_rows(
    kind: str | Sequence[str],
    x_arcsec: FloatArray,
    y_arcsec: FloatArray,
    flux_cgs: FloatArray,
    rate_cps: FloatArray,
    *,
    core_radius_arcsec: FloatArray | float = np.nan,
    beta: FloatArray | float = np.nan,
    redshift: FloatArray | float = np.nan,
    group_id: IntArray | int = -1,
    group_sep_arcsec: FloatArray | float = np.nan,
) -> ArrayFrame:
    """Table of sources with the columns of `SKY_COLUMNS`, one row a source.

    x_arcsec, y_arcsec, flux_cgs, rate_cps: (n,). The others: (n,) or one value for all.
    """
    n = len(x_arcsec)

    def column(values: FloatArray | float) -> FloatArray:
        return np.full(n, values) if np.isscalar(values) else np.asarray(values, dtype=np.float64)

    return ArrayFrame(
        {
            "kind": Texts.repeated(kind, n) if isinstance(kind, str) else Texts.of(kind),
            "x_arcsec": column(x_arcsec),
            "y_arcsec": column(y_arcsec),
            "flux_cgs": column(flux_cgs),
            "rate_cps": column(rate_cps),
            "core_radius_arcsec": column(core_radius_arcsec),
            "beta": column(beta),
            "redshift": column(redshift),
            "group_id": np.full(n, group_id, dtype=np.int32),
            "group_sep_arcsec": column(group_sep_arcsec),
        }
    )
