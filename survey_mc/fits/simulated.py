"""A simulated field as a FITS file to look at, or to give to any other detection program.

Idea     the counts are the primary image, so every program opens them; what an observer may not have (the true
         background, the origin of the photons, the true sources) follows in named extensions.
Source   FITS standard 4.0; OGIP keywords; IVOA UCD1+.
Limits   a simulation has no pointing of its own: it is put where the caller says, north up, east to the left.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.columns import DETECTIONS, REALISATION, SOURCE_ID, TRUTH, Column
from survey_mc.errors import BadInput
from survey_mc.fits.container import quiet
from survey_mc.fits.wcs import FIRST_PIXEL_FITS, icrs_deg
from survey_mc.fits.writing import (
    ascii_text,
    check_target,
    creator,
    fits_bytes,
    parameter_cards,
    table_unit,
    write_whole,
)
from survey_mc.types import Field, FloatArray, IntArray, PixelGrid
from survey_mc.units import ARCSEC_PER_DEG

if TYPE_CHECKING:
    from astropy.io.fits import Header
    from astropy.wcs import WCS

_TRUE_RA = Column("RA", "float64", "true right ascension, ICRS", "deg", "pos.eq.ra")
_TRUE_DEC = Column("DEC", "float64", "true declination, ICRS", "deg", "pos.eq.dec")
_PHOTON_COLUMNS = (*(c for c in DETECTIONS.columns if c.name in ("x_pix", "y_pix")), SOURCE_ID)


@quiet()
def write_simulated_field(
    path: str | Path,
    field: Field,
    *,
    pointing_deg: tuple[float, float] = (0.0, 0.0),
    telescope: str = "",
    instrument: str = "",
    parameters: dict[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write COUNTS (primary), EXPOSURE (s), BACKGROUND (true expected counts), PHOTONS and TRUTH.

    pointing_deg: ICRS right ascension and declination of the optical axis. parameters: anything JSON can hold
    (campaign, seed, cell, realisation …), kept in the header with the key of the field. Raises `BadInput`.
    """
    from astropy.io import fits

    check_target(path, overwrite)
    wcs = pointed_wcs(field.observation.grid, pointing_deg)
    observation = field.observation
    counts = fits.PrimaryHDU(np.asarray(observation.counts, dtype=np.int32), header=_image_header(wcs, "count"))
    counts.name = "COUNTS"
    for key, value, comment in _cards(field, telescope, instrument, pointing_deg, parameters or {}):
        counts.header[key] = (value, comment)
    units = [
        counts,
        fits.ImageHDU(np.asarray(observation.exposure_s), header=_image_header(wcs, "s"), name="EXPOSURE"),
        fits.ImageHDU(np.asarray(field.background_expected), header=_image_header(wcs, "count"), name="BACKGROUND"),
        *([] if observation.photons_pix is None else [_photons(observation.photons_pix, field.origin)]),
        _truth(field, wcs),
    ]
    write_whole(path, fits_bytes(fits.HDUList(units)), overwrite)


def pointed_wcs(grid: PixelGrid, pointing_deg: tuple[float, float]) -> WCS:
    """Tangent-plane WCS whose reference pixel is the optical axis: north up, right ascension growing to the left."""
    from astropy.wcs import WCS

    ra_deg, dec_deg = pointing_deg
    if not (0.0 <= ra_deg <= 360.0 and -90.0 <= dec_deg <= 90.0):
        raise BadInput(
            "pointing_deg", f"must be a right ascension 0..360 and a declination -90..90 (got {pointing_deg})"
        )
    wcs = WCS(naxis=2)
    wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    wcs.wcs.cunit = ["deg", "deg"]
    wcs.wcs.crval = [ra_deg, dec_deg]
    wcs.wcs.crpix = [grid.axis_pix[0] + FIRST_PIXEL_FITS, grid.axis_pix[1] + FIRST_PIXEL_FITS]
    wcs.wcs.cdelt = [-grid.scale_arcsec / ARCSEC_PER_DEG, grid.scale_arcsec / ARCSEC_PER_DEG]
    wcs.wcs.radesys = "ICRS"
    wcs.wcs.set()
    return wcs


def _image_header(wcs: WCS, unit: str) -> Header:
    header = wcs.to_header()
    header["BUNIT"] = unit
    return header


def _cards(
    field: Field, telescope: str, instrument: str, pointing_deg: tuple[float, float], parameters: dict[str, Any]
) -> list[tuple[str, Any, str]]:
    band, exposure_s = field.observation.band, float(field.observation.exposure_s.max())
    cards: list[tuple[str, Any, str]] = [
        ("TELESCOP", ascii_text(telescope), "simulated telescope"),
        ("INSTRUME", ascii_text(instrument), "simulated instrument"),
        ("OBJECT", "simulated field", ""),
        ("EXPOSURE", exposure_s, "[s] largest value of the exposure map"),
        ("BAND", ascii_text(band.name), "energy band"),
        ("E_MIN", band.energy_min_kev, "[keV] lower band limit"),
        ("E_MAX", band.energy_max_kev, "[keV] upper band limit"),
        ("E_UNIT", "keV", ""),
        ("RA_PNT", pointing_deg[0], "[deg] optical axis, ICRS"),
        ("DEC_PNT", pointing_deg[1], "[deg] optical axis, ICRS"),
        ("CREATOR", creator(), "program that wrote this file"),
    ]
    known = [c for c in cards if c[1] != "" and not (isinstance(c[1], float) and not np.isfinite(c[1]))]
    return known + parameter_cards({"key": field.key, **parameters})


def _photons(photons_pix: FloatArray, origin: IntArray) -> Any:
    """Every photon with the source it came from (-1: background)."""
    import pandas as pd

    frame = pd.DataFrame({"x_pix": photons_pix[:, 0], "y_pix": photons_pix[:, 1], "source_id": origin})
    return table_unit("PHOTONS", _PHOTON_COLUMNS, frame)


def _truth(field: Field, wcs: WCS) -> Any:
    """The true sources; images (a folded sky) have a position only if the truth table gives one."""
    truth = field.truth
    ra_deg, dec_deg = icrs_deg(wcs, truth["x_pix"].to_numpy(), truth["y_pix"].to_numpy())
    columns = tuple(column for column in TRUTH.columns if column is not REALISATION)
    return table_unit("TRUTH", (_TRUE_RA, _TRUE_DEC, *columns), truth.assign(RA=ra_deg, DEC=dec_deg))
