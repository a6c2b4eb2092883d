"""Images that are not counts: exposure maps, background maps, predicted skies.

Idea     a map must say or be told its unit, and lie on the pixels of its image; what was not observed is 0.
Source   XMM-Newton eexpmap (s), esplinemap (counts/pixel); eROSITA ML_BKG (counts/arcmin²); Chandra mkexpmap (cm² s).
Limits   no resampling: a map on another grid is refused. An effective-area map (cm² s) is refused, since its division
         into area and time is not in the file.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.fits.container import Hdu, quiet, read_hdu
from survey_mc.fits.header import MAX_EXPOSURE_S, text
from survey_mc.fits.image import MAX_COUNTS, image_values, refuse_scale, refuse_where
from survey_mc.fits.unit_text import MAX_CHARACTERS, unit_from_text
from survey_mc.fits.wcs import MAX_MISALIGNMENT_PIX, celestial_wcs, misalignment_pix, pixel_scale_arcsec
from survey_mc.types import FloatImage, PixelGrid, SkyImage
from survey_mc.units import ARCSEC_PER_ARCMIN

if TYPE_CHECKING:
    from astropy.wcs import WCS

# Spellings of the field that the FITS unit grammar does not know.
_SPELLINGS = {"counts": "count", "cts": "ct", "pixels": "pixel", "px": "pix", "secs": "s", "sec": "s", "seconds": "s"}
_SPELLINGS |= {"second": "s", "photons": "count", "photon": "count", "ergs": "erg"}

BACKGROUND_UNITS = ("count/pixel", "count/arcmin2", "count/s/pixel", "count/s/arcmin2")
SKY_UNITS = ("ct/s/pixel", "ct/s/arcmin2", "erg/s/cm2/pixel", "erg/s/cm2/arcmin2")


@quiet()
def read_exposure_map(
    path: str | Path, shape: tuple[int, int], wcs: WCS | None, hdu: int | str | None = None
) -> FloatImage:
    """Exposure × vignetting (s) on the pixels of an image; (ny, nx) float64.

    NaN means not observed and becomes 0. BUNIT must be a time if it is there (without: seconds). Refused: negative or
    infinite values, a map that is 0 everywhere, another shape, corners more than half a pixel off (when both have WCS).
    """
    unit, where, values = _map_on(path, hdu, "EXPOSURE", shape, wcs)
    bunit = text(unit.header, "BUNIT", where)
    values *= _factor(bunit, {"s": 1.0}, where, ("s", "ks")) if bunit else 1.0
    values[np.isnan(values)] = 0.0
    refuse_where(~np.isfinite(values), values, where, "exposure must be finite")
    refuse_where(values < 0.0, values, where, "exposure must not be negative")
    refuse_where(values > MAX_EXPOSURE_S, values, where, f"exposure must be at most {MAX_EXPOSURE_S:g} s")
    if not values.any():
        raise BadInput(where, "the exposure map is 0 everywhere: nothing was observed")
    return values


@quiet()
def read_background_map(
    path: str | Path, grid: PixelGrid, exposure_s: FloatImage, unit: str | None = None, hdu: int | str | None = None
) -> FloatImage:
    """Expected background counts per pixel; (ny, nx) float64.

    unit: one of `BACKGROUND_UNITS`, overrides BUNIT; without either counts per pixel. Rates are multiplied by
    exposure_s, pixel by pixel, so a rate map must be un-vignetted. NaN is allowed only where exposure_s is 0.
    """
    hdu_read, where, values = _map_on(path, hdu, "BACKGROUND", grid.shape, grid.wcs)
    pixel_arcmin2 = (grid.scale_arcsec / ARCSEC_PER_ARCMIN) ** 2
    stated = unit or text(hdu_read.header, "BUNIT", where) or "count/pixel"
    is_rate, factor = False, 1.0
    try:
        factor = _factor(stated, {"count": 1.0, "count / arcmin2": pixel_arcmin2}, where, BACKGROUND_UNITS)
    except BadInput:
        factor = _factor(stated, {"count / s": 1.0, "count / (s arcmin2)": pixel_arcmin2}, where, BACKGROUND_UNITS)
        is_rate = True
    values *= factor
    values[np.isnan(values) & (exposure_s == 0.0)] = 0.0
    refuse_where(~np.isfinite(values), values, where, "background must be finite where there is exposure")
    refuse_where(values < 0.0, values, where, "background must not be negative")
    refuse_where(values > MAX_COUNTS, values, where, f"background must be at most {MAX_COUNTS}")
    return np.asarray(values * exposure_s) if is_rate else values


@quiet()
def read_sky_image(
    path: str | Path,
    *,
    pixel_scale_arcsec: float | None = None,
    unit: str | None = None,
    flux_per_rate_cgs: float | None = None,
    hdu: int | str | None = None,
) -> SkyImage:
    """A predicted sky: on-axis count rate of each square pixel, to be folded through an instrument.

    unit: one of `SKY_UNITS`, overrides BUNIT; one of both is needed. Flux units need flux_per_rate_cgs (erg/cm²/s of
    one ct/s). pixel_scale_arcsec: overrides the WCS; one of both is needed. The image centre goes on the optical axis.
    """
    hdu_read, _ = read_hdu(path, hdu, "image")
    where = f"{path}[{hdu_read.index}]"
    values = image_values(hdu_read, where)
    refuse_where(~np.isfinite(values), values, where, "sky brightness must be finite")
    refuse_where(values < 0.0, values, where, "sky brightness must not be negative")
    scale_arcsec = _sky_scale(hdu_read, where, (values.shape[0], values.shape[1]), pixel_scale_arcsec)
    stated = unit or text(hdu_read.header, "BUNIT", where)
    if not stated:
        raise BadInput(where, f"a sky image needs a unit: BUNIT or the unit option, one of {', '.join(SKY_UNITS)}")
    pixel_arcmin2 = (scale_arcsec / ARCSEC_PER_ARCMIN) ** 2
    targets = {"ct / s": 1.0, "ct / (s arcmin2)": pixel_arcmin2}
    if flux_per_rate_cgs is not None:
        targets["erg / (s cm2)"] = 1.0 / flux_per_rate_cgs
        targets["erg / (s cm2 arcmin2)"] = pixel_arcmin2 / flux_per_rate_cgs
    rate_cps = values * _factor(stated, targets, where, SKY_UNITS if flux_per_rate_cgs is not None else SKY_UNITS[:2])
    refuse_where(~np.isfinite(rate_cps), rate_cps, where, "count rates must be finite")
    rate_cps.setflags(write=False)
    return SkyImage(rate_cps, scale_arcsec)


def _map_on(
    path: str | Path, hdu: int | str | None, name: str, shape: tuple[int, int], wcs: WCS | None
) -> tuple[Hdu, str, FloatImage]:
    """A map that lies on the pixels of the image: the asked HDU, else the one of that name, else the first image."""
    try:
        unit, _ = read_hdu(path, name if hdu is None else hdu, "image")
    except BadInput:
        if hdu is not None:
            raise
        unit, _ = read_hdu(path, None, "image")
    where = f"{path}[{unit.index}]"
    values = image_values(unit, where)
    if values.shape != tuple(shape):
        n_y, n_x = values.shape
        raise BadInput(where, f"must have the {shape[1]} × {shape[0]} pixels of its image (got {n_x} × {n_y})")
    map_wcs = celestial_wcs(unit.header, where) if wcs is not None else None
    if wcs is not None and map_wcs is not None:
        distance_pix = misalignment_pix(wcs, map_wcs, shape)
        if not distance_pix <= MAX_MISALIGNMENT_PIX:
            raise BadInput(
                where,
                f"its WCS must agree with that of its image within {MAX_MISALIGNMENT_PIX:g} pixel"
                f" (a corner is {distance_pix:.3g} pixels off); resample the map",
            )
    return unit, where, values


def _sky_scale(unit: Hdu, where: str, shape: tuple[int, int], scale_given_arcsec: float | None) -> float:
    if scale_given_arcsec is not None:
        refuse_scale(scale_given_arcsec, where)
        return scale_given_arcsec
    wcs = celestial_wcs(unit.header, where)
    if wcs is None:
        raise BadInput(
            where, "no WCS where one is needed: its header has no celestial coordinates; give the pixel scale"
        )
    return pixel_scale_arcsec(wcs, shape, where)


def _factor(stated: str, targets: dict[str, float], where: str, allowed: tuple[str, ...]) -> float:
    """What values in the stated unit are multiplied by; "per pixel" and a bare quantity mean the same.

    targets: unit → factor of that unit. The first that has the same physical dimensions is taken.
    """
    from astropy import units

    found: Any = None
    words = "".join(_SPELLINGS.get(word.casefold(), word) for word in _words(stated[:MAX_CHARACTERS]))
    try:
        found = unit_from_text(words)
        if units.pix in found.bases:
            found = found * units.pix
        for target, factor in targets.items():
            if found.is_equivalent(units.Unit(target)):
                scaled = float(found.to(units.Unit(target))) * factor
                if 0.0 < scaled < math.inf:
                    return scaled
    except Exception as error:  # conversions between strange units raise several types
        raise BadInput(where, f"unit must be one of {', '.join(allowed)} (got {stated[:MAX_CHARACTERS]!r})") from error
    raise BadInput(where, f"unit must be one of {', '.join(allowed)} (got {stated[:MAX_CHARACTERS]!r})")


def _words(stated: str) -> list[str]:
    """Runs of letters, and what is between them."""
    runs: list[str] = []
    for letter in stated:
        if runs and runs[-1][-1].isalpha() == letter.isalpha():
            runs[-1] += letter
        else:
            runs.append(letter)
    return runs
