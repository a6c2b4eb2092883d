"""Parameters of the maximum-likelihood fit, and what they mean for the fit of one image.

Idea     thresholds are given on the scale of the catalogue (DET_ML, EXT_ML) and turned once into falls of C, so the
         fit compares numbers. DET_ML = −ln Q(ν/2, L'), L' = ΔC/2, ν = 3 for a point and 4 for an extended source.
Source   XMM-SAS task emldetect. Versions before 4.27 gave DET_ML and EXT_ML twice too large (its change log);
         the paper used 3.7.2. Names in brackets in the descriptions are the task's.
Limits   ν = 1 is taken for EXT_ML, which the task's description leaves open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.special import gammaincc, gammainccinv, gammaln

from survey_mc.detect.detector import DetectorParams
from survey_mc.types import FloatArray, Psf

POINT_NU, EXTENDED_NU, EXTENT_NU = 3, 4, 1  # free parameters judged by DET_ML and EXT_ML
LEGACY_FACTOR = 2.0
LARGEST_GROUP = 10  # sources in one fit
LARGEST_CUT_PIX = 40.0
ASYMPTOTIC_FROM = 500.0  # of L': beyond it Q underflows soon
EXTENT_STARTS_PIX = (2.0, 4.0, 10.0)
OVERLAP_HEW = 1.25  # sources closer than this many half-energy widths are refitted to judge one another …
BLEND_HEW = 2.0  # … and those closer than this may be parts of one extended source


@dataclass(frozen=True, slots=True)
class Limits:
    """What decides in the fit of one image; all falls are of C.

    cut_pix, group_pix: radii of the pixels fitted and of neighbours fitted together. overlap_pix: distance within which
    sources are refitted to judge one; blend_pix: within which points may be parts of an extended source. point_fall,
    extended_fall: of a source worth keeping. extent_fall: of an extent. extent_min_place: smallest accepted extent, as
    a place on the sequence of extents; extent_starts: where fits of it start.
    """

    cut_pix: float
    group_pix: float
    overlap_pix: float
    blend_pix: float
    max_shift_pix: float
    n_max_fit: int
    n_mul_sou: int
    two_stage: bool
    point_fall: float
    extended_fall: float
    extent_fall: float
    extents_pix: FloatArray
    extent_min_place: float
    extent_starts: FloatArray
    profile_errors: bool
    width: int
    height: int

    @property
    def fit_extent(self) -> bool:
        return self.extents_pix.size > 0

    @property
    def extent_step(self) -> float:
        """Step of the sequence of extents in ln(extent)."""
        return math.log(self.extents_pix[1] / self.extents_pix[0]) if self.fit_extent else 0.0

    def extent_pix(self, place: FloatArray) -> FloatArray:
        """Extent (pixels) at places on the sequence; 0 without extents."""
        if not self.fit_extent:
            return np.zeros(np.shape(place))
        return np.asarray(np.exp(np.interp(place, np.arange(self.extents_pix.size), np.log(self.extents_pix))))


class MlFitParams(DetectorParams):
    """Parameters of the fit."""

    ml_min: float = Field(10.0, ge=1.0, le=500.0, description="least DET_ML of a detection, on det_ml_scale [mlmin]")
    det_ml_scale: Literal["correct", "legacy2x"] = Field(
        "legacy2x",
        description="DET_ML and EXT_ML as defined, or twice that as before version 4.27 of the task (the paper)",
    )
    ecut: float = Field(
        0.68,
        ge=0.4,
        le=LARGEST_CUT_PIX,
        description="radius of the pixels fitted around each source: fraction of the PSF if < 1, else pixels [ecut]",
    )
    group_cut: float = Field(
        0.90,
        ge=0.4,
        le=LARGEST_CUT_PIX,
        description="radius of neighbours fitted together: fraction of the PSF if < 1, else pixels [scut]",
    )
    n_max_fit: int = Field(3, ge=1, le=LARGEST_GROUP, description="most candidates fitted together [nmaxfit]")
    n_mul_sou: int = Field(2, ge=1, le=3, description="most sources one candidate may be split into [nmulsou]")
    two_stage: bool = Field(
        False,
        description="test one extended source in place of a point and its neighbours before any splitting, instead of "
        "testing extents at the end, each against the finished model [withtwostage]",
    )
    extent_model: Literal["beta", "gaussian", "none"] = Field(
        "beta", description="shape of extended sources: (1 + r²/EXT²)^−3/2, Gaussian of σ = EXT, or points only"
    )
    ext_ml_min: float = Field(10.0, ge=1.0, le=500.0, description="least EXT_ML of an extent, on its scale [dmlextmin]")
    min_extent_pix: float = Field(1.5, ge=1.0, le=20.0, description="smallest accepted extent (pixels) [minextent]")
    max_extent_pix: float = Field(20.0, ge=2.0, le=40.0, description="largest extent (pixels) [maxextent]")
    max_shift_pix: float = Field(
        5.0, ge=1.0, le=20.0, description="furthest a source may move from its candidate (pixels, in x and y)"
    )
    errors: Literal["fisher", "profile"] = Field(
        "fisher",
        description="errors from the inverse Fisher matrix, or offsets that raise C by 1 with all else refitted (slow)",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.n_max_fit * self.n_mul_sou > LARGEST_GROUP:
            product = f"{self.n_max_fit} × {self.n_mul_sou}"
            raise ValueError(f"n_max_fit × n_mul_sou must be at most {LARGEST_GROUP} (got {product})")
        if self.max_extent_pix <= self.min_extent_pix:
            raise ValueError(
                f"max_extent_pix must be larger than min_extent_pix (got {self.max_extent_pix}, {self.min_extent_pix})"
            )
        return self

    @property
    def likelihood_unit(self) -> float:
        """What DET_ML and EXT_ML are multiplied by on the scale chosen."""
        return LEGACY_FACTOR if self.det_ml_scale == "legacy2x" else 1.0


def likelihood(fall: FloatArray, nu: FloatArray | int) -> FloatArray:
    """−ln Q(ν/2, ΔC/2): DET_ML or EXT_ML of a fall ΔC, on the correct scale; finite for any fall ≥ 0."""
    half = np.maximum(np.asarray(fall, dtype=np.float64), 0.0) / 2.0
    a = np.asarray(nu) / 2.0
    large = np.maximum(half, ASYMPTOTIC_FROM)
    asymptotic = large - (a - 1.0) * np.log(large) + gammaln(a) - np.log1p((a - 1.0) / large)
    near = -np.log(gammaincc(a, np.minimum(half, ASYMPTOTIC_FROM)))
    return np.asarray(np.where(half > ASYMPTOTIC_FROM, asymptotic, near))


def fall_of_likelihood(value: float, nu: int) -> float:
    """ΔC that gives this likelihood (correct scale), the inverse of `likelihood`."""
    return 2.0 * float(gammainccinv(nu / 2.0, math.exp(-value)))


def cut_radius_pix(psf: Psf, scale_arcsec: float, cut: float) -> float:
    """Radius of a cut given as a fraction of the PSF (< 1) or in pixels; at least a pixel, at most LARGEST_CUT_PIX."""
    if cut >= 1.0:
        return cut

    def missing(radius_pix: float) -> float:
        return float(psf.encircled_energy(np.asarray(radius_pix * scale_arcsec))) - cut

    if missing(LARGEST_CUT_PIX) <= 0.0:
        return LARGEST_CUT_PIX
    from scipy.optimize import brentq  # a driver does without

    return max(float(brentq(missing, 0.0, LARGEST_CUT_PIX, xtol=1e-9)), 1.5)


def fit_limits(
    params: MlFitParams, psf: Psf, scale_arcsec: float, shape: tuple[int, int], extents_pix: FloatArray
) -> Limits:
    """The parameters as the fit wants them."""
    unit = params.likelihood_unit
    places = np.arange(extents_pix.size)
    smallest, starts = 0.0, np.zeros(0)
    if extents_pix.size:
        smallest = float(np.interp(math.log(params.min_extent_pix), np.log(extents_pix), places))
        wanted = np.clip(EXTENT_STARTS_PIX, params.min_extent_pix, params.max_extent_pix)
        starts = np.unique(np.interp(np.log(wanted), np.log(extents_pix), places))
    return Limits(
        cut_pix=cut_radius_pix(psf, scale_arcsec, params.ecut),
        group_pix=cut_radius_pix(psf, scale_arcsec, params.group_cut),
        overlap_pix=OVERLAP_HEW * psf.hew_arcsec / scale_arcsec,
        blend_pix=BLEND_HEW * psf.hew_arcsec / scale_arcsec,
        max_shift_pix=params.max_shift_pix,
        n_max_fit=params.n_max_fit,
        n_mul_sou=params.n_mul_sou,
        two_stage=params.two_stage and extents_pix.size > 0,
        point_fall=fall_of_likelihood(params.ml_min / unit, POINT_NU),
        extended_fall=fall_of_likelihood(params.ml_min / unit, EXTENDED_NU),
        extent_fall=fall_of_likelihood(params.ext_ml_min / unit, EXTENT_NU),
        extents_pix=extents_pix,
        extent_min_place=smallest,
        extent_starts=starts,
        profile_errors=params.errors == "profile",
        width=shape[1],
        height=shape[0],
    )
