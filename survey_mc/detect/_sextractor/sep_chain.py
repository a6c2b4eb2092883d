"""SExtractor's extraction through sep: background mesh, connected pixels above a threshold, deblending, cleaning.

Idea     the search image is already filtered, so nothing is convolved here; every saddle splits an object (64 levels,
         zero contrast).
Source   paper Sect. 3.4; Bertin & Arnouts 1996 A&AS 117, 393; Barbary 2016 JOSS 1, 58 (sep).
Limits   sep has neither isophotal areas nor CLASS_STAR; they are made elsewhere. Its buffer limits are
         process-wide: one thread only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import sep
from numpy.typing import NDArray
from pydantic import Field, field_validator

from survey_mc.detect._sextractor.seeing import smoothed_fwhm_arcsec
from survey_mc.detect._sextractor.stellarity import FILE_SUFFIX, SHIPPED_NETWORKS, is_shipped, open_network
from survey_mc.detect.detector import DetectorParams
from survey_mc.types import BoolArray, IntImage, Psf

FLAG_MERGED = 1 << 0  # bits 0 to 7 as in sep
FLAG_TRUNCATED = 1 << 1
FLAG_DEBLEND_OVERFLOW = 1 << 2
FLAG_SINGULAR = 1 << 3
FLAG_APERTURE_TRUNCATED = 1 << 4
FLAG_APERTURE_MASKED = 1 << 5
FLAG_NON_POSITIVE = 1 << 7
FLAG_KRON_CLIPPED = 1 << 8  # the Kron radius was at a limit of its allowed range
FLAG_LIMITS_RAISED = 1 << 9  # sep's buffers overflowed and were enlarged for this field
FLAG_NOT_DEBLENDED = 1 << 10  # even the enlarged buffers overflowed: extracted without deblending

FLAG_BITS = {
    FLAG_MERGED: "object was deblended from another",
    FLAG_TRUNCATED: "object is cut by the image border",
    FLAG_DEBLEND_OVERFLOW: "deblending overflow inside sep",
    FLAG_SINGULAR: "moments are singular (a line or a point of pixels)",
    FLAG_APERTURE_TRUNCATED: "aperture is cut by the image border",
    FLAG_APERTURE_MASKED: "aperture contains unobserved or neighbours' pixels",
    FLAG_NON_POSITIVE: "light in the Kron ellipse is not positive",
    FLAG_KRON_CLIPPED: "Kron radius was clipped to its allowed range",
    FLAG_LIMITS_RAISED: "sep's buffer limits were raised for this field",
    FLAG_NOT_DEBLENDED: "field was extracted without deblending",
}

RAISED_SUB_OBJECTS = 16384  # sep starts with 1024, too few for zero contrast in a crowded field
RAISED_BUFFER_PER_PIX = 2  # entries a pixel of the image, more than an image entirely above the threshold needs
NO_DEBLENDING_LEVELS = 1

Float32Image = NDArray[np.float32]


class SepParams(DetectorParams):
    """Parameters of the extraction and the photometry, shared by the mixed procedures."""

    mesh_pix: int = Field(32, ge=8, le=4096, description="side of a background mesh (pixels); the paper: 32 to 64")
    mesh_filter: int = Field(3, ge=1, le=15, description="width of the median filter of the background (meshes)")
    mesh_filter_threshold: float = Field(
        0.0, ge=0.0, description="median filter only where it changes a mesh by more than this (counts per pixel)"
    )
    minarea_pix: int = Field(
        5, ge=1, le=10_000, description="smallest number of connected pixels above the threshold (pixels)"
    )
    deblend_levels: int = Field(64, ge=1, le=1024, description="number of deblending levels, exponentially spaced")
    deblend_contrast: float = Field(
        0.0, ge=0.0, le=1.0, description="smallest share of the flux a branch needs; 0 splits at every saddle, 1 never"
    )
    clean: bool = Field(True, description="drop detections that are the wing of a brighter neighbour")
    clean_param: float = Field(1.0, gt=0.0, le=10.0, description="strength of the cleaning; larger cleans less")
    kron_integration: float = Field(
        6.0, ge=0.1, le=100.0, description="ellipse in which the Kron radius is measured (units of the rms axes a, b)"
    )
    kron_factor: float = Field(2.5, ge=0.1, le=100.0, description="aperture size (Kron radii)")
    kron_radius_min: float = Field(3.5, ge=0.1, le=100.0, description="smallest aperture (units of the rms axes a, b)")
    neighbours: Literal["mirror", "blank", "ignore"] = Field(
        "mirror",
        description="pixels of other detections in the aperture: replaced by the opposite pixel (SExtractor's "
        "CORRECT), empty, or counted as the source's",
    )
    measure_on: Literal["filtered", "raw"] = Field(
        "filtered", description="image for counts and half-light radius: the filtered one (paper) or the photon image"
    )
    aperture_correction: Literal["none", "psf_table"] = Field(
        "none", description="none (paper), or divide counts by the encircled energy of the believed PSF in the aperture"
    )
    stellarity_network: str = Field(
        "xmm_epic",
        max_length=1000,
        description=f"neural network of the stellarity index: {', '.join(SHIPPED_NETWORKS)}, or the path of a file in "
        "SExtractor's format (.nnw), in a campaign below its folder",
    )
    seeing_arcsec: float | None = Field(
        None,
        ge=0.01,
        le=3600.0,
        description="FWHM of a point source in the filtered image for the stellarity index (arcsec); default: believed "
        "PSF and filter together",
    )

    @field_validator("stellarity_network")
    @classmethod
    def _name_or_file(cls, network: str) -> str:
        if not is_shipped(network) and not network.endswith(FILE_SUFFIX):
            raise ValueError(f"must be {', '.join(SHIPPED_NETWORKS)}, or the path of a file that ends in {FILE_SUFFIX}")
        return network

    def seeing(self, psf: Psf, scale_arcsec: float) -> float:
        """FWHM (arcsec) of a point source for the stellarity index; psf: the believed one."""
        return self.seeing_arcsec or smoothed_fwhm_arcsec(psf, self.filter_sigma_pix(scale_arcsec), scale_arcsec)

    def filter_sigma_pix(self, scale_arcsec: float) -> float:
        """Standard deviation of the Gaussian that widens a point source as the filter does; 0: no filter."""
        return 0.0

    def input_files(self) -> dict[str, str]:
        return {} if is_shipped(self.stellarity_network) else {"stellarity_network": self.stellarity_network}


def check_network(params: SepParams, shape: tuple[int, int]) -> None:
    """Raise BadInput if the network of the stellarity index cannot be used; it fits images of any shape."""
    open_network(params.stellarity_network)


@dataclass(frozen=True, slots=True)
class Extraction:
    """sep's object table, its segmentation map (0 = sky, i + 1 = object i) and the flag bits common to all objects."""

    objects: NDArray[np.void]
    segments: IntImage
    flags: int


def mesh_background(image: Float32Image, masked: BoolArray, params: SepParams) -> sep.Background:
    """Background mesh of an image; masked pixels (True) are left out."""
    height, width = image.shape
    return sep.Background(
        image,
        mask=masked if masked.any() else None,
        bw=min(params.mesh_pix, width),
        bh=min(params.mesh_pix, height),
        fw=params.mesh_filter,
        fh=params.mesh_filter,
        fthresh=params.mesh_filter_threshold,
    )


def extract(signal: Float32Image, threshold: Float32Image, masked: BoolArray, params: SepParams) -> Extraction:
    """Connected pixels above the threshold map, deblended; never fails for a crowded field.

    signal: background-subtracted image; threshold: > 0, same unit. sep's limits stay small, because a large buffer
    costs more than a usual field; they are raised for one call when they overflow, and put back.
    """
    buffer_pix, sub_objects = sep.get_extract_pixstack(), sep.get_sub_object_limit()
    raised = (max(RAISED_BUFFER_PER_PIX * signal.size, buffer_pix), max(RAISED_SUB_OBJECTS, sub_objects))
    attempts = (
        ((buffer_pix, sub_objects), params.deblend_levels, 0),
        (raised, params.deblend_levels, FLAG_LIMITS_RAISED),
        (raised, NO_DEBLENDING_LEVELS, FLAG_LIMITS_RAISED | FLAG_NOT_DEBLENDED),
    )
    overflow: Exception | None = None
    for limits, levels, flags in attempts:
        try:
            objects, segments = _extract_within(limits, signal, threshold, masked, levels, params)
        except Exception as problem:  # sep raises bare exceptions; only the overflows are ours to cure
            if "overflow" not in str(problem) and "pixel buffer" not in str(problem):
                raise
            overflow = problem
        else:
            return Extraction(objects, segments, flags)
    raise RuntimeError("sep overflowed even without deblending") from overflow


def _extract_within(
    limits: tuple[int, int],
    signal: Float32Image,
    threshold: Float32Image,
    masked: BoolArray,
    levels: int,
    params: SepParams,
) -> tuple[NDArray[np.void], IntImage]:
    """One call of sep.extract under the given (buffer pixels, sub-objects) limits, which are restored afterwards."""
    before = (sep.get_extract_pixstack(), sep.get_sub_object_limit())
    if limits != before:
        sep.set_extract_pixstack(limits[0])
        sep.set_sub_object_limit(limits[1])
    try:
        objects, segments = sep.extract(
            signal,
            1.0,
            err=threshold,
            mask=masked if masked.any() else None,
            minarea=params.minarea_pix,
            filter_kernel=None,
            deblend_nthresh=levels,
            deblend_cont=params.deblend_contrast,
            clean=params.clean,
            clean_param=params.clean_param,
            segmentation_map=True,
        )
    finally:
        if limits != before:
            sep.set_extract_pixstack(before[0])
            sep.set_sub_object_limit(before[1])
    return objects, segments
