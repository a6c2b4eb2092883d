"""Parameters of WAVDETECT.

Idea     every option of wtransform and wrecon that matters here is named; kept apart from the procedure, so that both
         are read at a glance.
Source   paper Sect. 3.3 (tail, scales); CIAO ahelp wavdetect, wtransform, wrecon for the rest of the defaults.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from pydantic import Field, field_validator, model_validator

from survey_mc.detect.detector import DetectorParams

SQRT2_SCALES_PIX = tuple(2.0 ** (k / 2.0) for k in range(9))  # 1 … 16
LARGEST_SCALE_PIX = 64.0
LEAST_TAIL, LARGEST_TAIL = 1e-9, 0.01


class WavdetectParams(DetectorParams):
    """Parameters of WAVDETECT."""

    scales_pix: tuple[float, ...] = Field(
        SQRT2_SCALES_PIX, min_length=1, max_length=24, description="wavelet scales σ, ascending (pixels)"
    )
    threshold: Literal["freeman", "exact"] = Field(
        "freeman", description="the original's fit to simulations, or the exact Poisson distribution of the correlation"
    )
    sigthresh: float = Field(
        1e-4, ge=LEAST_TAIL, le=LARGEST_TAIL, description="false-alarm probability per pixel and scale (paper: 1e-4)"
    )
    false_per_scale: float | None = Field(
        None,
        gt=0.0,
        le=1e6,
        description="expected false pixels per image and scale; replaces sigthresh by this over the analysed pixels",
    )
    photons_min: float = Field(
        2.0,
        ge=1.0,
        le=1e3,
        description="no threshold is below the correlation of this many photons in a pixel (photons)",
    )
    background: Literal["wavelet", "granted"] = Field(
        "wavelet", description="read from the wavelet's negative ring, or the map the campaign grants"
    )
    # The ring of σ = 1 averages 25 pixels, 4.5 photons at 10 ks: with its own ring at each scale a blank field has 165
    # false detections instead of 35 (the paper's Tests 1 and 2: 21 and 18).
    background_min_scale_pix: float = Field(
        8.0,
        ge=0.0,
        le=LARGEST_SCALE_PIX,
        description="smaller scales use the background of the first scale from this one on (pixels); 0: each its own",
    )
    bkg_sig_thresh: float = Field(
        1e-3, ge=LEAST_TAIL, le=0.05, description="tail of pixels that are left out of the background (probability)"
    )
    max_iter: int = Field(2, ge=0, le=20, description="most rounds of background cleansing per scale")
    iter_stop: float = Field(
        1e-4, ge=0.0, le=1.0, description="cleansing ends when the source pixels change by this share of all pixels"
    )
    exp_thresh: float = Field(
        0.1, ge=0.0, lt=1.0, description="no detections where the exposure is below this share of its maximum"
    )
    psf_ecf: float = Field(
        0.393, ge=0.01, le=0.95, description="encircled fraction that defines the PSF's size (0.393: 1σ of a Gaussian)"
    )
    flux_scales_pix: tuple[float, ...] | None = Field(
        None,
        min_length=1,
        max_length=24,
        description="scales, out of scales_pix, among which the one nearest to the PSF's size smooths the flux image "
        "(pixels); none: all",
    )
    ell_sigma: float = Field(3.0, gt=0.0, le=100.0, description="source ellipses are drawn at this many σ")
    centroid: Literal["photons", "net"] = Field(
        "net", description="positions weighted by the photons of the cell, or by photons − background"
    )
    aperture_correction: Literal["none", "psf_cell"] = Field(
        "none", description="counts as the cell holds them, or divided by the share of the PSF in the cell"
    )

    @field_validator("scales_pix")
    @classmethod
    def _ascending(cls, scales: tuple[float, ...]) -> tuple[float, ...]:
        if any(not 0.5 <= s <= LARGEST_SCALE_PIX for s in scales):
            raise ValueError(f"scales_pix must be 0.5 … {LARGEST_SCALE_PIX:g} pixels (got {list(scales)})")
        if any(b <= a for a, b in pairwise(scales)):
            raise ValueError(f"scales_pix must ascend (got {list(scales)})")
        return scales

    @model_validator(mode="after")
    def _flux_scales_are_scales(self) -> WavdetectParams:
        unknown = [s for s in self.flux_scales_pix or () if s not in self.scales_pix]
        if unknown:
            raise ValueError(f"flux_scales_pix must be among scales_pix (got {unknown})")
        return self
