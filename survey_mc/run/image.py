"""One procedure on one real image."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from survey_mc.campaign.sentences import sentence_of
from survey_mc.detect import DETECTORS, check_detections, with_native_names
from survey_mc.detect.detector import Detector, DetectorParams
from survey_mc.errors import BadInput
from survey_mc.fits import FileObservation, observation_from_files
from survey_mc.registry import UnknownName
from survey_mc.rng import stream
from survey_mc.telescope.psf import KingPsf
from survey_mc.types import Skip

if TYPE_CHECKING:
    from pandas import DataFrame

# Tab. 1 of the paper: what a procedure believes of the PSF unless it is told otherwise.
PSF_FWHM_ARCSEC = 6.0
PSF_HEW_ARCSEC = 15.0


@dataclass(frozen=True, slots=True)
class ImageDetections:
    """What was found on an image, and how.

    detections: `columns.DETECTIONS` without realisation, the detector's own, and those the original program names
    otherwise under its names. notes: what was assumed.
    """

    detections: DataFrame
    detector: Detector
    params: DetectorParams
    source: FileObservation
    notes: tuple[str, ...]


def method_params(method: str, given: Mapping[str, Any], profile: str = "paper") -> tuple[Detector, DetectorParams]:
    """A registered detector and its parameters: those of a profile with the given ones in their place."""
    detector = DETECTORS[method]
    if profile not in detector.profiles:
        raise UnknownName(f"profile of {method}", profile, detector.profiles)
    content = {**detector.profiles[profile].model_dump(), **given}
    try:
        # The strict rules of a campaign file: a text is no number and a truth value is no 1.
        text = json.dumps(content, default=str)
        return detector, detector.params.model_validate_json(text, strict=True)
    except ValidationError as error:
        raise BadInput(f"parameter of {method}", sentence_of(error, detector.params, content)) from None


def detect_image(
    image: Path | str,
    method: str = "mr1_se",
    params: Mapping[str, Any] | None = None,
    *,
    profile: str = "paper",
    psf_fwhm_arcsec: float = PSF_FWHM_ARCSEC,
    psf_hew_arcsec: float = PSF_HEW_ARCSEC,
    seed: int = 0,
    **files: Any,
) -> ImageDetections:
    """Detect sources on a FITS counts image.

    params: parameters that differ from the profile. psf_fwhm_arcsec, psf_hew_arcsec: the PSF the procedure believes.
    files: exposure_path, background_path, exposure_s, flux_per_rate_cgs, pixel_scale_arcsec and the other options of
    `fits.observation_from_files`. seed: of procedures that draw random numbers. Raises `BadInput`.
    """
    detector, chosen = method_params(method, params or {}, profile)
    if not 0.0 < psf_fwhm_arcsec * 1.001 <= psf_hew_arcsec <= psf_fwhm_arcsec * 100.0:
        raise BadInput(
            "PSF",
            "the half-energy width must be 1.001 to 100 times the FWHM, both positive "
            f"(got FWHM {psf_fwhm_arcsec:g}″, HEW {psf_hew_arcsec:g}″)",
        )
    source = observation_from_files(image, psf=KingPsf.from_fwhm_hew(psf_fwhm_arcsec, psf_hew_arcsec), **files)
    try:
        found = detector.detect(source.observation, chosen, stream(f"detect/{seed}", method))
    except ValueError as problem:
        raise BadInput(str(image), f"{method}: {problem}") from problem
    if isinstance(found, Skip):
        raise BadInput(str(image), f"{method} cannot work on this image: {found.reason}")
    rows = with_native_names(detector, check_detections(detector, source.observation, found))
    return ImageDetections(rows, detector, chosen, source, source.notes)
