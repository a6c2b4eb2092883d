"""What a campaign may choose about matching.

Idea     both rules are always computed and stored; `rule` only says which one the tables take as their headline.
Source   Valtchanov et al. 2001, Sect. 6.2 (6″, 10′, more than 10 counts) and Sect. 8 (30 counts at 100 ks);
         photon origin after Liu et al. 2022, A&A 661, A27.
Limits   sources are never selected on the photons they happened to give (that would be an Eddington-type bias).
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

MATCH_VERSION = 2  # part of the key of every result; raised when an answer changes

RuleName = Literal["nearest", "origin"]
Assignment = Literal["nearest_from_detection", "mutual", "one_to_one"]
Fraction = Annotated[float, Field(gt=0.0, le=1.0)]

COUNTS_MIN_DEFAULT = 10.0  # Sect. 6.2
EXPOSURE_TOLERANCE_KS = 1e-9


class MatchParams(BaseModel):
    """How detections are compared with the true sources."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    rule: RuleName = Field(
        "nearest",
        description="rule the tables use: nearest (position, the paper's) or origin (photons); both are stored",
    )
    radius_arcsec: PositiveFloat = Field(6.0, le=3600.0, description="search radius of the nearest rule (arcsec)")
    assignment: Assignment = Field(
        "nearest_from_detection",
        description="nearest rule: nearest_from_detection (each detection takes its nearest source, the closest keeps "
        "it), mutual (each must be the other's nearest) or one_to_one (most pairs, then least total separation)",
    )
    region_arcmin: PositiveFloat = Field(
        10.0, le=600.0, description="only sources and detections inside this off-axis angle"
    )
    counts_min: NonNegativeFloat | dict[str, NonNegativeFloat] = Field(
        COUNTS_MIN_DEFAULT,
        description="count limit of the input list: one number, or one for each exposure (ks): { 10 = 10, 100 = 30 }",
    )
    counts_min_on: Literal["counts_expected", "counts_onaxis"] = Field(
        "counts_expected",
        description="counts the limit applies to: expected (vignetted) or on axis (rate × exposure, the paper's)",
    )
    link_radius_arcsec: PositiveFloat = Field(
        30.0, le=3600.0, description="all pairs up to this separation go to the links table"
    )
    origin_radius_arcsec: PositiveFloat = Field(
        15.0, description="photon aperture of a detection: this radius, or its r50 where larger"
    )
    aperture_max_arcsec: PositiveFloat = Field(
        120.0, le=3600.0, description="largest photon aperture, whatever r50 says"
    )
    origin_counts_min: PositiveInt = Field(3, description="least photons for a source to be the origin of a detection")
    origin_chance_max: Fraction = Field(
        0.02, description="largest chance that the background alone gives as many photons as source and background"
    )
    blend_fraction: Fraction = Field(
        1.0 / 3.0, description="photons of the second source over those of the first that make a blend"
    )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.link_radius_arcsec < self.radius_arcsec:
            raise ValueError(
                f"link_radius_arcsec must be at least radius_arcsec = {self.radius_arcsec:g} "
                f"(got {self.link_radius_arcsec:g})"
            )
        if self.aperture_max_arcsec < self.origin_radius_arcsec:
            raise ValueError(
                f"aperture_max_arcsec must be at least origin_radius_arcsec = {self.origin_radius_arcsec:g} "
                f"(got {self.aperture_max_arcsec:g})"
            )
        if isinstance(self.counts_min, dict):
            for key in self.counts_min:
                _exposure_of(key)
        return self

    def limit(self, exposure_ks: float) -> float:
        """Count limit of the input list at an exposure; ValueError names the exposure that has none."""
        if not isinstance(self.counts_min, dict):
            return self.counts_min
        for key, limit in self.counts_min.items():
            if abs(_exposure_of(key) - exposure_ks) <= EXPOSURE_TOLERANCE_KS * exposure_ks:
                return limit
        known = ", ".join(sorted(self.counts_min, key=_exposure_of)) or "none"
        raise ValueError(f"counts_min has no limit for {exposure_ks:g} ks (given for: {known})")


def _exposure_of(key: str) -> float:
    """Exposure (ks) written as the key of a `counts_min` table."""
    try:
        exposure_ks = float(key)
    except ValueError:
        exposure_ks = float("nan")
    if not 0.0 < exposure_ks < float("inf"):
        raise ValueError(f"counts_min: keys are exposures in ks, such as 10 or 100 (got {key!r})")
    return exposure_ks
