"""Detections as a FITS catalogue, and back.

Idea     sky and FITS pixel coordinates, the columns every procedure shares, its own, and those that the original
         program calls otherwise once more under its name; each with unit, UCD and meaning in the header, so that
         TOPCAT and astropy show them.
Source   IVOA UCD1+; XMM-Newton RADEC_ERR: the quadratic sum of both coordinate errors.
Limits   x_pix, y_pix count the first pixel centre as 0, X_IMAGE, Y_IMAGE as 1 (SExtractor, DS9); RA, DEC are there only
         if the image has a WCS. No date is written: equal results are equal bytes.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.columns import DEC, RA, RADEC_ERR, X_IMAGE, Y_IMAGE, Column
from survey_mc.detect.contract import declared_columns, native_columns, with_native_names
from survey_mc.detect.detector import Detector, DetectorParams
from survey_mc.errors import BadInput
from survey_mc.fits.container import quiet, read_hdu
from survey_mc.fits.header import ImageFacts, text
from survey_mc.fits.wcs import fits_from_pix, icrs_deg
from survey_mc.fits.writing import (
    ascii_text,
    check_target,
    creator,
    fits_bytes,
    parameter_cards,
    table_unit,
    write_whole,
)
from survey_mc.types import Observation

if TYPE_CHECKING:
    from pandas import DataFrame

EXTENSION = "DETECTIONS"


@dataclass(frozen=True, slots=True)
class Catalogue:
    """A catalogue read back. detections: all columns of the file; parameters: of the procedure `method`."""

    detections: DataFrame
    method: str
    version: int
    parameters: dict[str, Any]


@quiet()
def write_catalogue(
    path: str | Path,
    detections: DataFrame,
    *,
    detector: Detector,
    params: DetectorParams,
    observation: Observation,
    facts: ImageFacts | None = None,
    overwrite: bool = False,
) -> None:
    """Write detections (`columns.DETECTIONS` without realisation, then the detector's own columns) as a FITS table.

    Columns with a native name are there under both. facts: what is known of the image, for the header. Zero rows are
    written as a table of zero rows. Raises `BadInput` if the file exists (without overwrite) or cannot be written.
    """
    from astropy.io import fits

    check_target(path, overwrite)
    frame, sky = _with_sky(detections, observation)
    native = native_columns(detector)
    frame = with_native_names(detector, frame)
    unit = table_unit(EXTENSION, (*sky, *declared_columns(detector), *(column for column, _ in native)), frame)
    if observation.grid.wcs is not None:
        unit.header["RADESYS"] = "ICRS"
    for key, value, comment in _cards(detector, params, observation, facts or ImageFacts()):
        unit.header[key] = (value, comment)
    unit.header.add_comment("x_pix, y_pix: first pixel centre at 0; X_IMAGE, Y_IMAGE: first pixel centre at 1.")
    write_whole(path, fits_bytes(fits.HDUList([fits.PrimaryHDU(), unit])), overwrite)


def _with_sky(detections: DataFrame, observation: Observation) -> tuple[DataFrame, tuple[Column, ...]]:
    """The frame with sky and FITS pixel coordinates, and the columns that were added."""
    grid = observation.grid
    x_pix, y_pix = detections["x_pix"].to_numpy(), detections["y_pix"].to_numpy()
    added: dict[str, Any] = {X_IMAGE.name: fits_from_pix(x_pix), Y_IMAGE.name: fits_from_pix(y_pix)}
    columns: tuple[Column, ...] = (X_IMAGE, Y_IMAGE)
    if grid.wcs is not None:
        added[RA.name], added[DEC.name] = icrs_deg(grid.wcs, x_pix, y_pix)
        columns = (RA, DEC, RADEC_ERR, X_IMAGE, Y_IMAGE)
        error_pix = np.hypot(detections["x_err_pix"].to_numpy(), detections["y_err_pix"].to_numpy())
        added[RADEC_ERR.name] = error_pix * grid.scale_arcsec
    return detections.assign(**added), columns


def _cards(
    detector: Detector, params: DetectorParams, observation: Observation, facts: ImageFacts
) -> list[tuple[str, Any, str]]:
    band = observation.band
    cards: list[tuple[str, Any, str]] = [
        ("CREATOR", creator(), "program that wrote this file"),
        ("SMCMETH", detector.name, "detection procedure"),
        ("SMCVERS", detector.version, "version of the procedure"),
        ("SMCREF", ascii_text(detector.reference), ""),
        ("IMAGE", ascii_text(facts.file_name), "image that was searched"),
        ("TELESCOP", ascii_text(facts.telescope), ""),
        ("INSTRUME", ascii_text(facts.instrument), ""),
        ("FILTER", ascii_text(facts.filter_name), ""),
        ("OBS_ID", ascii_text(facts.obs_id), ""),
        ("OBJECT", ascii_text(facts.object_name), ""),
        ("EXPOSURE", facts.exposure_s, "[s] of the image header"),
        ("BAND", ascii_text(band.name), "energy band"),
        ("E_MIN", band.energy_min_kev, "[keV] lower band limit"),
        ("E_MAX", band.energy_max_kev, "[keV] upper band limit"),
        ("E_UNIT", "keV", ""),
        ("FLUXCONV", band.flux_per_rate_cgs, "[erg/cm2/s] flux of one on-axis ct/s"),
        ("PIXSCALE", observation.grid.scale_arcsec, "[arcsec] side of a pixel"),
        ("PSFHEW", observation.psf.hew_arcsec, "[arcsec] half-energy width that was believed"),
    ]
    known = [c for c in cards if c[1] not in (None, "") and not (isinstance(c[1], float) and not np.isfinite(c[1]))]
    return known + parameter_cards(params.model_dump(mode="json"))


@quiet()
def read_catalogue(path: str | Path) -> Catalogue:
    """Read a catalogue that `write_catalogue` wrote; raises `BadInput` for anything else."""
    import pandas as pd
    from astropy.io import fits

    unit, _ = read_hdu(path, EXTENSION, "table")
    where = f"{path}[{unit.index}]"
    try:
        records = fits.BinTableHDU.fromstring(unit.head + unit.data).data
        frame = pd.DataFrame({name: _native(records[name]) for name in records.names})
        parameters = json.loads(text(unit.header, "SMCPARAM", where) or "{}")
        version = int(text(unit.header, "SMCVERS", where))
    except Exception as error:  # a table of other origin fails in as many ways as there are
        raise BadInput(where, f"is not a catalogue of this program ({type(error).__name__}: {error})") from error
    return Catalogue(frame, text(unit.header, "SMCMETH", where), version, parameters)


def _native(values: Any) -> Any:
    """Values in the byte order of the machine, text as Python strings."""
    array = np.asarray(values)
    if array.dtype.kind in "SU":
        return [str(value) for value in array]
    return array.astype(array.dtype.newbyteorder("="))
