"""Where the pixels are on the sky.

Idea     only the celestial cards of axes 1 and 2 reach the WCS library; the pixel is then measured, not trusted:
         square, right-angled and of one size over the image, else refused.
Source   Greisen & Calabretta 2002, A&A 395, 1061; Calabretta & Greisen 2002, A&A 395, 1077.
Limits   one pixel size per image: fields many degrees wide are refused. Pixels are counted from (0, 0) at the centre of
         the first one; FITS files count that centre as (1, 1), and these two functions alone convert.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.fits.header import card, number, text
from survey_mc.types import FloatArray
from survey_mc.units import ARCSEC_PER_DEG

if TYPE_CHECKING:
    from astropy.io.fits import Header
    from astropy.wcs import WCS

FIRST_PIXEL_FITS = 1.0
MAX_ANISOTROPY = 0.01  # relative difference of pixel sides, of sizes over the image, cosine of the corner angle
MAX_MISALIGNMENT_PIX = 0.5
MAX_SIP_ORDER = 9  # Shupe et al. 2005, ADASS XIV, 491
MAX_PARAMETERS = 100  # cards PVi_m: the most a projection has is 2 × 40 (TPV)

_TEXT_CARDS = re.compile(r"CTYPE[12]|CUNIT[12]|RADESYS|RADECSYS")
_NUMBER_CARDS = re.compile(
    r"(CRPIX|CRVAL|CDELT|CROTA)[12]|(CD|PC)[12]_[12]|PC00[12]00[12]|PV[12]_\d+|LONPOLE|LATPOLE|EQUINOX"
)
_SIP_CARDS = re.compile(r"(A|B|AP|BP)_(ORDER|\d_\d)")


def fits_from_pix(pix: FloatArray) -> FloatArray:
    """FITS pixel coordinate (first centre at 1) of ours (first centre at 0)."""
    return np.asarray(pix, dtype=np.float64) + FIRST_PIXEL_FITS


def pix_from_fits(fits_pix: FloatArray) -> FloatArray:
    """Our pixel coordinate (first centre at 0) of that of a FITS file (first centre at 1)."""
    return np.asarray(fits_pix, dtype=np.float64) - FIRST_PIXEL_FITS


def celestial_wcs(header: Header, where: str) -> WCS | None:
    """The celestial WCS of axes 1 and 2, None when the header has none. Malformed cards are refused by name."""
    from astropy.io import fits
    from astropy.wcs import WCS

    clean = fits.Header({"NAXIS": 2, "WCSAXES": 2})
    # Distortion coefficients hold only under CTYPE "…-SIP": without it they are left over from another image.
    n_parameters = 0
    has_sip = any(text(header, key, where).endswith("-SIP") for key in ("CTYPE1", "CTYPE2"))
    for key in dict.fromkeys(header.keys()):
        if _TEXT_CARDS.fullmatch(key) and (value := card(header, key, where)) is not None:
            if not isinstance(value, str):
                raise BadInput(where, f"{key} must be text (got {value!r})")
            clean[key] = value
        elif _NUMBER_CARDS.fullmatch(key) and (value := number(header, key, where)) is not None:
            n_parameters += key.startswith("PV")
            if n_parameters > MAX_PARAMETERS:
                raise BadInput(where, f"has more than {MAX_PARAMETERS} projection parameters (cards PVi_m)")
            clean[key] = value
        elif has_sip and _SIP_CARDS.fullmatch(key) and (value := number(header, key, where)) is not None:
            clean[key] = _sip_order(key, value, where) if key.endswith("_ORDER") else value
    if "CTYPE1" not in clean and "CTYPE2" not in clean:
        return None
    try:
        wcs = WCS(clean)
    except Exception as error:  # wcslib reports through a dozen exception types
        raise BadInput(where, f"its celestial coordinates (WCS) cannot be used ({_first_line(error)})") from error
    if not wcs.has_celestial:
        return None
    if not any(key in clean for key in ("CDELT1", "CD1_1", "CD1_2")):
        raise BadInput(where, "its WCS has no pixel size (neither CDELT nor CD cards)")
    _refuse_other_skies(wcs, where)
    return wcs


def _refuse_other_skies(wcs: WCS, where: str) -> None:
    """Raise `BadInput` for a WCS whose positions have no ICRS coordinates: of the Sun, or of an unknown RADESYS."""
    from astropy.coordinates import ICRS
    from astropy.wcs.utils import wcs_to_celestial_frame

    try:
        known = bool(wcs_to_celestial_frame(wcs).is_transformable_to(ICRS()))
    except Exception:  # astropy raises several types for what it does not know
        known = False
    if not known:
        raise BadInput(
            where,
            "its celestial coordinates are none that can be converted to ICRS "
            f"(CTYPE1 {wcs.wcs.ctype[0]!r}, RADESYS {wcs.wcs.radesys!r})",
        )


def _sip_order(key: str, value: float, where: str) -> int:
    if not 0 <= value <= MAX_SIP_ORDER:
        raise BadInput(where, f"{key} must be 0..{MAX_SIP_ORDER} (got {value:g})")
    return int(value)


def pixel_scale_arcsec(wcs: WCS, shape: tuple[int, int], where: str) -> float:
    """Side of the square pixels, measured at the image centre; refuses pixels that are not square and equal."""
    n_y, n_x = shape
    x_pix = np.array([(n_x - 1) / 2.0, 0.0, n_x - 1.0, 0.0, n_x - 1.0])
    y_pix = np.array([(n_y - 1) / 2.0, 0.0, 0.0, n_y - 1.0, n_y - 1.0])
    along_x = _unit_vectors(wcs, x_pix + 0.5, y_pix, where) - _unit_vectors(wcs, x_pix - 0.5, y_pix, where)
    along_y = _unit_vectors(wcs, x_pix, y_pix + 0.5, where) - _unit_vectors(wcs, x_pix, y_pix - 0.5, where)
    with np.errstate(all="ignore"):
        width = np.degrees(np.linalg.norm(along_x, axis=1)) * ARCSEC_PER_DEG
        height = np.degrees(np.linalg.norm(along_y, axis=1)) * ARCSEC_PER_DEG
        cosine = np.degrees(1.0) ** 2 * ARCSEC_PER_DEG**2 * np.sum(along_x * along_y, axis=1) / (width * height)
        size = np.sqrt(width * height)
    if not (np.all(np.isfinite(size)) and np.all(size > 0.0)):
        raise BadInput(where, "its WCS does not give every pixel a place on the sky")
    if abs(width[0] / height[0] - 1.0) > MAX_ANISOTROPY or abs(cosine[0]) > MAX_ANISOTROPY:
        angle_deg = np.degrees(np.arccos(np.clip(cosine[0], -1.0, 1.0)))
        raise BadInput(
            where,
            f"pixels must be square within {MAX_ANISOTROPY:.0%}"
            f' (got {width[0]:.4g}" × {height[0]:.4g}", {angle_deg:.1f}° between the axes); resample the image',
        )
    sides = np.concatenate([width, height])
    if np.any(np.abs(sides / size[0] - 1.0) > MAX_ANISOTROPY):
        raise BadInput(
            where,
            f"pixels must have one size within {MAX_ANISOTROPY:.0%} over the image"
            f' (got {sides.min():.4g}" to {sides.max():.4g}"); cut the image into tiles',
        )
    return float(size[0])


def _unit_vectors(wcs: WCS, x_pix: FloatArray, y_pix: FloatArray, where: str) -> FloatArray:
    """(n, 3) directions in the frame of the WCS."""
    try:
        world_deg = wcs.all_pix2world(np.column_stack([x_pix, y_pix]), 0)
    except Exception as error:
        raise BadInput(where, f"its WCS cannot be evaluated ({_first_line(error)})") from error
    lon, lat = np.radians(world_deg[:, wcs.wcs.lng]), np.radians(world_deg[:, wcs.wcs.lat])
    return np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def icrs_deg(wcs: WCS, x_pix: FloatArray, y_pix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """ICRS right ascension and declination (deg) of pixel positions, whatever the frame of the image."""
    if len(x_pix) == 0:
        return np.empty(0), np.empty(0)
    sky = wcs.pixel_to_world(np.asarray(x_pix, dtype=np.float64), np.asarray(y_pix, dtype=np.float64)).icrs
    return np.asarray(sky.ra.deg, dtype=np.float64), np.asarray(sky.dec.deg, dtype=np.float64)


def pix_of_pointing(wcs: WCS, ra_deg: float, dec_deg: float) -> tuple[float, float] | None:
    """Pixel of a right ascension and declination in the equatorial frame of the image; None when it has no pixel."""
    from astropy.coordinates import SkyCoord
    from astropy.wcs.utils import wcs_to_celestial_frame

    try:
        frame = wcs_to_celestial_frame(wcs)
        equatorial = frame if frame.name in ("icrs", "fk5", "fk4") else "icrs"
        x_pix, y_pix = wcs.world_to_pixel(SkyCoord(ra_deg, dec_deg, unit="deg", frame=equatorial))
    except Exception:  # a declination beyond 90°, or a distortion that cannot be inverted there: no pixel
        return None
    place = float(x_pix), float(y_pix)
    return place if np.all(np.isfinite(place)) else None


def misalignment_pix(image_wcs: WCS, map_wcs: WCS, shape: tuple[int, int]) -> float:
    """Largest distance (pixels) between where two WCS put the corners of an image; inf when they cannot be compared."""
    from astropy.wcs.utils import pixel_to_pixel

    n_y, n_x = shape
    x_pix, y_pix = np.array([0.0, n_x - 1.0, 0.0, n_x - 1.0]), np.array([0.0, 0.0, n_y - 1.0, n_y - 1.0])
    try:
        x_map, y_map = pixel_to_pixel(image_wcs, map_wcs, x_pix, y_pix)
    except Exception:
        return float("inf")
    distance = np.hypot(x_map - x_pix, y_map - y_pix)
    return float(distance.max()) if np.all(np.isfinite(distance)) else float("inf")


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
