"""EWAVELET: Mexican-hat maxima over scales; every source a Gaussian.

Idea     correlate with Mexican hats, keep significant maxima, choose for each source the scale of highest correlation
         C; there it has 4πσ²C counts, and C at the neighbouring scale gives its width. The background is a ring mean
         of the image without the sources found so far.
Source   paper Sect. 3.3 (1e-4 threshold, scales 1, 2, 4, 8, 16 pix); ewavelet of the XMM-Newton SAS; Damiani et al.
         1997, ApJ 483, 350. Differs: what the exposure map itself gives in the transform is subtracted (Freeman et al.
         2002), so that masks and vignetting make no sources; small scales do not use their own narrow ring.
Weak at  photometry: the PSF is no Gaussian, so a point source has its highest C at the smallest scale and loses 40 % of
         its counts, unless corrected; extended sources with a point on top, or broken by their own noise, for the same
         reason.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from survey_mc.columns import Column
from survey_mc.detect._ewavelet.damiani_threshold import damiani_threshold, exact_threshold
from survey_mc.detect._ewavelet.hat_ring import exposure_response, hat_ring
from survey_mc.detect._ewavelet.measure import Measured, measure
from survey_mc.detect._ewavelet.psf_response import counts_per_photon
from survey_mc.detect._ewavelet.search import Found, Image, Rules, reconstruct, search
from survey_mc.detect._shared.observed import granted_background, observed_pixels
from survey_mc.detect._shared.rows import COMMON_COLUMNS, Values, detections_frame, empty_frame
from survey_mc.detect.detector import Detector, DetectorParams, ExtentStatistic
from survey_mc.types import BoolArray, FloatArray, FloatImage, Observation

if TYPE_CHECKING:
    from pandas import DataFrame
LARGEST_SCALE_SHARE = 8.0  # of the shorter side of the image: room for the ring of the largest scale
LEAST_SCALE_STEP = 1.1  # ratio of neighbouring scales below which C cannot tell them apart
FWHM_PER_SIGMA = math.sqrt(8.0 * math.log(2.0))
R50_PER_SIGMA = math.sqrt(2.0 * math.log(2.0))
# The formula of EXTENT for the PSF of the paper (King of FWHM 6″ and half-energy width 15″, in pixels of 4″) gives 2.0,
# 2.8, 3.9 and 5.6 pixels at the scales 1–2, 2–4, 4–8 and 8–16.
EXTENT_OF_PSF_PIX = 5.6
WSCALE_OF_R50_PIX = 4.0  # a Gaussian of r50 = 20″, the paper's cut, has σ = 4.2 pixels of 4″
LEAST_CORRECTED_SHARE = 0.01  # of the PSF's photons; a PSF far wider than the hat fills its ring and gives none
LEAST_RING_SHARE = 0.8  # exposed share of the background ring, relative to the exposure at the source

FLAG_NO_EXTENT = 1 << 0
FLAG_LARGEST_SCALE = 1 << 1
FLAG_EDGE = 1 << 2
FLAG_NOT_INTERPOLATED = 1 << 3
FLAG_UNCORRECTED = 1 << 4

FLAG_BITS = {
    FLAG_NO_EXTENT: "no Gaussian width fits the two scales; half-light radius from WSCALE",
    FLAG_LARGEST_SCALE: "highest correlation at the largest scale: the source may be larger",
    FLAG_EDGE: "an image border, a mask or steep vignetting cuts into the background ring",
    FLAG_NOT_INTERPOLATED: "the maximum touches the border or a mask: position is that of the pixel",
    FLAG_UNCORRECTED: "counts not corrected: the scale sees less than a hundredth of the PSF",
}

EXTRA_COLUMNS = (
    Column("IMAX", "int32", "column of the maximum, first pixel 0", "pixel", "pos.cartesian.x;instr.det"),
    Column("JMAX", "int32", "row of the maximum, first pixel 0", "pixel", "pos.cartesian.y;instr.det"),
    Column("WSCALE", "float64", "scale σ of highest correlation", "pixel", "phys.angSize;src"),
    Column("WCORR", "float64", "correlation C at the maximum, counts per pixel²", "count", "stat.value"),
    Column("EXTENT", "float64", "FWHM of the Gaussian that fits two scales, PSF included", "pixel", "phys.angSize;src"),
    Column("EXT_ERR", "float64", "1σ error of EXTENT", "pixel", "stat.error;phys.angSize"),
)  # fmt: skip


class EwaveletParams(DetectorParams):
    """Parameters of EWAVELET."""

    scales_pix: tuple[float, ...] = Field(
        (1.0, 2.0, 4.0, 8.0, 16.0),
        min_length=1,
        max_length=16,
        description="scales σ of the Mexican hat (pixels, 0.7 to 64, ascending); the largest at most 1/8 of the image",
    )
    threshold_kind: Literal["damiani", "exact"] = Field(
        "damiani", description="closed form in sigma (Damiani et al. 1997), or an exact Poisson false-alarm probability"
    )
    threshold_sigma: float = Field(
        3.72, gt=0.0, le=100.0, description="threshold of kind damiani (sigma); 3.72 is 1e-4 one-sided, the paper's"
    )
    false_alarm: float = Field(
        1e-4, ge=1e-12, le=0.1, description="threshold of kind exact (probability per pixel and scale, one-sided)"
    )
    photons_min: float = Field(
        2.0, ge=1.0, le=1e6, description="threshold is never below the peak of this many photons in one pixel (photons)"
    )
    iterations: int = Field(
        2, ge=1, le=10, description="estimates of the background: the first is flat, later ones leave out sources"
    )
    ring_scale_min_pix: float = Field(
        4.0,
        ge=0.0,
        le=64.0,
        description="smaller scales take the background ring of this scale (pixels); few photons "
        "in a narrow ring make the threshold noisy",
    )
    edge_threshold: float = Field(
        4.0, ge=0.0, le=100.0, description="least ratio of a maximum to the transform of the background map; 0: no rule"
    )
    exposure_share_min: float = Field(
        0.1, ge=0.0, le=1.0, description="pixels below this share of the largest exposure are not searched"
    )
    merge_rule: Literal["highest", "smallfirst"] = Field(
        "highest", description="which of the maxima of several scales is the source: of highest C, or of smallest scale"
    )
    merge_radius_sigma: float = Field(
        1.0, ge=0.0, le=10.0, description="maxima of two scales are one source within this (units of the larger scale)"
    )
    counts_correction: Literal["none", "psf_table"] = Field(
        "none", description="counts as for a Gaussian, or divided by what the scale gives of the believed PSF"
    )
    background: Literal["wavelet", "granted"] = Field(
        "wavelet", description="ring mean of the image without sources, or the map the campaign grants"
    )

    @model_validator(mode="after")
    def scales_ascend(self) -> Self:
        """Scales in order, apart, and within what can be sampled."""
        if min(self.scales_pix) < 0.7 or max(self.scales_pix) > 64.0:
            raise ValueError(f"scales_pix must be 0.7 to 64 pixels (got {self.scales_pix})")
        if any(large < LEAST_SCALE_STEP * small for small, large in pairwise(self.scales_pix)):
            raise ValueError(f"scales_pix must ascend by factors ≥ {LEAST_SCALE_STEP} (got {self.scales_pix})")
        return self


def check_scales(params: EwaveletParams, shape: tuple[int, int]) -> None:
    """ValueError if the largest scale is too large for an image of that shape."""
    largest = min(shape) / LARGEST_SCALE_SHARE
    if max(params.scales_pix) > largest:
        raise ValueError(
            f"scales_pix must be at most {largest:g} (1/8 of the image) for {shape[1]} × {shape[0]} pixels "
            f"(got {max(params.scales_pix):g})"
        )


def searched_image(observation: Observation, observed: BoolArray, params: EwaveletParams) -> Image:
    """Counts and relative exposure in single precision, and what the exposure itself gives in the transform."""
    exposure = np.asarray(observation.exposure_s / observation.exposure_s.max(), dtype=np.float32)
    counts = np.where(observed, observation.counts, 0).astype(np.float32)
    rings = tuple(max(sigma, min(params.ring_scale_min_pix, max(params.scales_pix))) for sigma in params.scales_pix)
    filters = hat_ring((counts.shape[0], counts.shape[1]), params.scales_pix, rings)
    return Image(counts, exposure, params.exposure_share_min, filters, exposure_response(exposure, filters))


def found_sources(observation: Observation, image: Image, params: EwaveletParams) -> Found:
    """Sources, planes and backgrounds of the last iteration."""

    def threshold(background_per_pix: FloatArray, sigma_pix: float) -> FloatArray:
        if params.threshold_kind == "exact":
            return exact_threshold(background_per_pix, sigma_pix, params.false_alarm)
        return damiani_threshold(background_per_pix, sigma_pix, params.threshold_sigma)

    rules = Rules(
        params.scales_pix,
        threshold,
        params.photons_min,
        params.edge_threshold,
        params.merge_rule,
        params.merge_radius_sigma,
    )
    granted = granted_background(observation).astype(np.float32) if params.background == "granted" else None
    return search(image, rules, params.iterations, granted)


def counts_factor(observation: Observation, scale_pix: FloatArray, params: EwaveletParams) -> FloatArray:
    """What the measured counts are divided by: 4πσ²C per photon of a point source, or 1; NaN if that is too small."""
    if params.counts_correction == "none":
        return np.ones(len(scale_pix))
    scales = np.array(params.scales_pix)
    factor = [counts_per_photon(observation.psf, observation.grid.scale_arcsec, sigma) for sigma in params.scales_pix]
    share = np.array(factor)[np.searchsorted(scales, scale_pix)]
    return np.where(share >= LEAST_CORRECTED_SHARE, share, np.nan)


def flags(image: Image, found: Found, measured: Measured) -> FloatArray:
    """Bit masks, see FLAG_BITS."""
    row, column = found.sources.pixel.T
    ring = np.array([one[row, column] for one in image.response.rings])[found.sources.scale, np.arange(len(row))]
    return np.asarray(
        FLAG_NO_EXTENT * np.isnan(measured.width_pix)
        | FLAG_LARGEST_SCALE * (found.sources.scale == len(found.planes) - 1)
        | FLAG_EDGE * (ring < LEAST_RING_SHARE * image.exposure[row, column])
        | FLAG_NOT_INTERPOLATED * ~measured.interpolated
    )


def rows(observation: Observation, image: Image, found: Found, params: EwaveletParams) -> Values:
    """The values of the detections' columns."""
    measured = measure(found, params.scales_pix)
    factor = counts_factor(observation, measured.scale_pix, params)
    uncorrected = np.isnan(factor)
    factor = np.where(uncorrected, 1.0, factor)
    width = np.where(np.isnan(measured.width_pix), measured.scale_pix, measured.width_pix)
    return {
        "x_pix": measured.x_pix,
        "y_pix": measured.y_pix,
        "x_err_pix": measured.position_err_pix,
        "y_err_pix": measured.position_err_pix,
        "counts": measured.counts / factor,
        "counts_err": measured.counts_err / factor,
        "background_per_pix": measured.background_per_pix,
        "significance": measured.significance,
        "r50_arcsec": R50_PER_SIGMA * width * observation.grid.scale_arcsec,
        "flags": flags(image, found, measured) | FLAG_UNCORRECTED * uncorrected,
        "IMAX": found.sources.pixel[:, 1],
        "JMAX": found.sources.pixel[:, 0],
        "WSCALE": measured.scale_pix,
        "WCORR": measured.correlation,
        "EXTENT": FWHM_PER_SIGMA * measured.width_pix,
        "EXT_ERR": FWHM_PER_SIGMA * measured.width_err_pix,
    }


def detect(observation: Observation, params: EwaveletParams, rng: np.random.Generator) -> DataFrame:
    """Detections of EWAVELET; deterministic, the generator is not used."""
    check_scales(params, (observation.counts.shape[0], observation.counts.shape[1]))
    observed = observed_pixels(observation)
    if not observed.any() or not observation.counts[observed].any():
        return empty_frame(COMMON_COLUMNS + EXTRA_COLUMNS)
    image = searched_image(observation, observed, params)
    found = found_sources(observation, image, params)
    return detections_frame(observation, rows(observation, image, found, params), EXTRA_COLUMNS)


def reconstructed_image(observation: Observation, params: EwaveletParams) -> FloatImage:
    """The sources as Gaussians of their scale on the background of the largest scale (counts per pixel)."""
    check_scales(params, (observation.counts.shape[0], observation.counts.shape[1]))
    observed = observed_pixels(observation)
    if not observed.any() or not observation.counts[observed].any():
        return np.zeros(observation.counts.shape)
    found = found_sources(observation, searched_image(observation, observed, params), params)
    gaussians = reconstruct(found.sources, params.scales_pix, observation.counts.shape)
    return np.where(observed, gaussians.astype(np.float64) + found.backgrounds[-1], 0.0)


# Blank false detections inside 10′ at 10 and 100 ks (30 fields each): 15.6 ± 0.7 and 15.4 ± 0.7 for PAPER; 5.4 ± 0.4
# and 5.9 ± 0.4 for PAPER_4SIGMA, near the paper's 4 and 5; 1.0 ± 0.2 and 1.1 ± 0.2 for MODERN.
PAPER = EwaveletParams()
PAPER_4SIGMA = EwaveletParams(threshold_sigma=4.0)
PAPER_CORRECTED = EwaveletParams(counts_correction="psf_table")
MODERN = EwaveletParams(
    scales_pix=(1.0, 1.414, 2.0, 2.828, 4.0, 5.657, 8.0, 11.31, 16.0),
    threshold_kind="exact",
    false_alarm=5e-6,
    edge_threshold=1.0,
    counts_correction="psf_table",
)

DETECTOR = Detector(
    name="ewavelet",
    label="EWAVELET",
    version=1,
    about="Mexican-hat maxima over scales; counts and extent of Gaussian sources at the scale of highest correlation",
    reference="Valtchanov, Pierre & Gastaud 2001, Sect. 3.3; Damiani et al. 1997",
    params=EwaveletParams,
    detect=detect,
    tiny=EwaveletParams(scales_pix=(1.0, 2.0, 4.0)),
    extra_columns=EXTRA_COLUMNS,
    view=reconstructed_image,
    profiles={"paper": PAPER, "paper_4sigma": PAPER_4SIGMA, "paper_corrected": PAPER_CORRECTED, "modern": MODERN},
    flag_bits=FLAG_BITS,
    check=check_scales,
    native_names={
        "SCTS": "counts",
        "SCTS_ERR": "counts_err",
        "RATE": "rate_cps",
        "EXP_MAP": "exposure_s",
        "BG_MAP": "background_per_pix",
        "X_IMA_ERR": "x_err_pix",
        "Y_IMA_ERR": "y_err_pix",
    },
    extent_statistics=(
        ExtentStatistic(
            "EXTENT", "fitted FWHM", EXTENT_OF_PSF_PIX, "largest of a point source's at any scales", "pixel"
        ),
        ExtentStatistic("WSCALE", "scale", WSCALE_OF_R50_PIX, "that of a Gaussian of r50 = 20″ (Sect. 7.3)", "pixel"),
    ),
)
