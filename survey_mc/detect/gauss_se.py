"""G+SE: Gaussian convolution, then SExtractor's chain.

Idea     smooth the photons with a Gaussian, take the excess over a background mesh, cut it at a multiple of its noise.
Source   paper Sect. 3.4 (FWHM 12″, or 20″ where clusters are wanted; threshold 4σ); Bertin & Arnouts 1996 through sep.
         Differs: unobserved pixels and the image border are corrected by normalised convolution, and the threshold
         rises there with the noise.
Weak at  close pairs (the kernel merges what is nearer than its FWHM); low counts, where "4σ" of a skewed
         distribution is a 1e-3 tail, and only the smallest area and the sources' own share of the rms hold false
         detections down.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from survey_mc.detect._sextractor.catalogue import SEP_COLUMNS, SEXTRACTOR_NAMES, Search, catalogue
from survey_mc.detect._sextractor.sep_chain import FLAG_BITS, SepParams, check_network, mesh_background
from survey_mc.detect._shared import smoothing
from survey_mc.detect._shared.exact_threshold import excess_threshold_map
from survey_mc.detect._shared.observed import granted_background, observed_pixels
from survey_mc.detect._shared.poisson_background import LEAST_BACKGROUND_PER_PIX, clipped_mean_background
from survey_mc.detect._shared.rows import COMMON_COLUMNS, empty_frame
from survey_mc.detect.detector import R50, STELLARITY, Detector
from survey_mc.types import BoolArray, FloatImage, Observation

if TYPE_CHECKING:
    from pandas import DataFrame
LEAST_EXPOSURE_SHARE = 1e-6  # of the largest exposure; stands for 0 in divisions
LARGEST_SIGMA_PIX = 128.0  # a kernel of 1025² pixels


class GaussSeParams(SepParams):
    """Parameters of G+SE."""

    fwhm_arcsec: float = Field(
        12.0, ge=0.1, le=600.0, description="FWHM of the Gaussian (arcsec); the paper: 12, or 20 where clusters matter"
    )
    threshold_kind: Literal["sigma", "poisson_exact"] = Field(
        "sigma", description="a multiple of the rms (paper), or an exact Poisson false-alarm probability"
    )
    threshold_sigma: float = Field(4.0, gt=0.0, le=1e3, description="threshold of kind sigma (units of the rms)")
    false_alarm: float = Field(
        1e-5, ge=1e-12, le=0.1, description="threshold of kind poisson_exact (probability per pixel, one-sided)"
    )
    rms: Literal["sep_background", "sep_local", "analytic"] = Field(
        "sep_background",
        description="rms of kind sigma: sep's global value (SExtractor's), its map, or √background × kernel norm",
    )
    photons_min: float = Field(
        2.0, ge=0.0, le=1e6, description="threshold is never below the peak of this many photons in one pixel (photons)"
    )
    divide_by_exposure: bool = Field(
        False, description="search the exposure-corrected image instead of the photon image (paper: no)"
    )
    background: Literal["sep_mode", "clipped_mean", "granted"] = Field(
        "sep_mode",
        description="sep's mode of the smoothed image (SExtractor's, low for few counts), mean photons in a moving box "
        "with sources clipped, or the map the campaign grants",
    )
    clip_box_pix: int = Field(128, ge=8, le=4096, description="width of the box of background clipped_mean (pixels)")
    minarea_pix: int = Field(
        11, ge=1, le=10_000, description="smallest number of connected pixels above the threshold (pixels)"
    )

    def filter_sigma_pix(self, scale_arcsec: float) -> float:
        return smoothing.sigma_pix_from_fwhm(self.fwhm_arcsec, scale_arcsec)


def kernel_sigma_pix(observation: Observation, params: GaussSeParams) -> float:
    """Standard deviation of the Gaussian (pixels); ValueError if its kernel is too large to be worked with."""
    scale_arcsec = observation.grid.scale_arcsec
    sigma_pix = params.filter_sigma_pix(scale_arcsec)
    if sigma_pix > LARGEST_SIGMA_PIX:
        largest = LARGEST_SIGMA_PIX * scale_arcsec / smoothing.SIGMA_PER_FWHM
        raise ValueError(
            f"fwhm_arcsec must be at most {largest:g} for pixels of {scale_arcsec:g}″ (got {params.fwhm_arcsec:g})"
        )
    return sigma_pix


def weights(observation: Observation, observed: BoolArray, params: GaussSeParams) -> FloatImage:
    """1 where observed, or the relative exposure where the image is to be exposure-corrected."""
    if params.divide_by_exposure:
        return np.asarray(observation.exposure_s / observation.exposure_s.max())
    return observed.astype(np.float64)


def filtered_image(observation: Observation, params: GaussSeParams) -> FloatImage:
    """The smoothed image (counts per pixel); 0 where nothing was observed."""
    observed = observed_pixels(observation)
    if not observed.any():
        return np.zeros(observation.counts.shape)
    sigma_pix = kernel_sigma_pix(observation, params)
    weight = weights(observation, observed, params)
    return smoothing.normalised_smoothing(observation.counts.astype(np.float64), weight, sigma_pix)


def background_map(
    observation: Observation, params: GaussSeParams, filtered: FloatImage, mode: FloatImage
) -> FloatImage:
    """Background of the smoothed image; mode: sep's. Units of the smoothed image."""
    if params.background == "sep_mode":
        return mode
    sigma_pix = kernel_sigma_pix(observation, params)
    observed = observed_pixels(observation)
    weight = weights(observation, observed, params)
    if params.background == "granted":
        photons = granted_background(observation)
    else:
        photons = clipped_mean_background(
            observation.counts.astype(np.float64),
            observation.exposure_s,
            filtered * weight,
            smoothing.gaussian_kernel(sigma_pix),
            params.clip_box_pix,
        )
    return smoothing.normalised_smoothing(photons, weight, sigma_pix)


def search_image(observation: Observation, params: GaussSeParams, observed: BoolArray) -> Search:
    """Smoothed image, background, threshold and noise."""
    sigma_pix = kernel_sigma_pix(observation, params)
    masked = ~observed
    smoothed = filtered_image(observation, params)
    filtered = np.ascontiguousarray(smoothed, dtype=np.float32)
    mesh = mesh_background(filtered, masked, params)
    background = background_map(observation, params, smoothed, np.asarray(mesh.back(), dtype=np.float64))
    relative = weights(observation, observed, params) if params.divide_by_exposure else None
    exposure_share = np.ones((1, 1)) if relative is None else np.maximum(relative, LEAST_EXPOSURE_SHARE)
    photons_per_pix = np.maximum(background * exposure_share, LEAST_BACKGROUND_PER_PIX)
    analytic = np.sqrt(photons_per_pix) * smoothing.noise_norm(sigma_pix) / exposure_share
    if params.threshold_kind == "poisson_exact":
        unit = analytic
        kernel = smoothing.gaussian_kernel(sigma_pix)
        threshold = excess_threshold_map(kernel, photons_per_pix, params.false_alarm) / exposure_share
    else:
        unit = analytic
        if params.rms == "sep_background":
            unit = np.full(filtered.shape, mesh.globalrms)
        elif params.rms == "sep_local":
            unit = np.asarray(mesh.rms(), dtype=np.float64)
        threshold = params.threshold_sigma * unit
    edge = smoothing.edge_noise_factor(observed, sigma_pix)
    least = params.photons_min * smoothing.peak_per_count(sigma_pix) / exposure_share
    unit = np.where(unit > 0.0, unit, analytic)  # an rms of 0 is what sep says of an almost empty image
    return Search(
        filtered,
        background.astype(np.float32),
        np.ascontiguousarray(np.maximum(threshold * edge, least), dtype=np.float32),
        np.ascontiguousarray(unit * edge, dtype=np.float32),
        masked,
        smoothing.gaussian_profile(sigma_pix),
        sigma_pix,
        relative,
    )


def detect(observation: Observation, params: GaussSeParams, rng: np.random.Generator) -> DataFrame:
    """Detections of G+SE; deterministic, the generator is not used."""
    observed = observed_pixels(observation)
    if not observed.any() or not observation.counts[observed].any():
        return empty_frame(COMMON_COLUMNS + SEP_COLUMNS)
    return catalogue(observation, search_image(observation, params, observed), params)


# The smallest area is tuned to at most one false detection inside 10′ of a blank 10 ks field: 0.86 ± 0.10 (80 fields).
PAPER = GaussSeParams()
CLUSTERS = GaussSeParams(fwhm_arcsec=20.0, minarea_pix=16)  # as many blank false detections as PAPER
MODERN = GaussSeParams(threshold_kind="poisson_exact", background="clipped_mean", measure_on="raw", minarea_pix=3)

DETECTOR = Detector(
    name="gauss_se",
    label="G+SE",
    version=2,
    about="Gaussian convolution followed by SExtractor's extraction, deblending and Kron photometry",
    reference="Valtchanov, Pierre & Gastaud 2001, Sect. 3.4; Bertin & Arnouts 1996",
    params=GaussSeParams,
    detect=detect,
    tiny=PAPER,
    extra_columns=SEP_COLUMNS,
    view=filtered_image,
    profiles={"paper": PAPER, "paper_clusters": CLUSTERS, "modern": MODERN},
    flag_bits=FLAG_BITS,
    native_names=SEXTRACTOR_NAMES,
    extent_statistics=(STELLARITY, R50),
    check=check_network,
)
