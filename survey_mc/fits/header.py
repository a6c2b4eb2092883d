"""What an image says about itself: header cards read one by one.

Idea     a card is absent, usable or refused by name; facts that only describe the image (exposure, band, telescope) are
         noted and left out when they are unusable, because the user can state them.
Source   FITS standard 4.0 sect. 4; OGIP names (E_MIN, ONTIME, …), XMM-Newton PIMIN/PIMAX and data subspace, in eV.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from survey_mc.errors import BadInput

if TYPE_CHECKING:
    from astropy.io.fits import Header

# EXPOSURE and LIVETIME have the dead time taken out, ONTIME has not (OGIP/92-007).
EXPOSURE_KEYS = ("EXPOSURE", "LIVETIME", "ONTIME", "EXPTIME")
EV_PER_KEV = 1000.0
MAX_SUBSPACE_CARDS = 20
MAX_EXPOSURE_S = 1e15  # a map in cm² s can have 1e10
MAX_WORDS = 200  # characters of a text card that are kept; a card has 68, continued ones any number
MAX_PLAUSIBLE_KEV = 100.0  # focusing X-ray telescopes end below; a larger E_MAX without a unit is in eV


@dataclass(frozen=True, slots=True)
class ImageFacts:
    """What the header says of the image; None or "" where it says nothing usable. notes: sentences for the user."""

    file_name: str = ""
    exposure_s: float | None = None
    energy_min_kev: float | None = None
    energy_max_kev: float | None = None
    telescope: str = ""
    instrument: str = ""
    filter_name: str = ""
    obs_id: str = ""
    object_name: str = ""
    notes: tuple[str, ...] = ()


def card(header: Header, key: str, where: str) -> Any:
    """Value of a card; None when it is absent or has no value."""
    from astropy.io.fits.card import Undefined

    try:
        value = header.get(key)
    except Exception as error:  # astropy's parser raises several types on malformed cards
        raise BadInput(where, f"the card {key} cannot be read") from error
    return None if isinstance(value, Undefined) else value


def integer(header: Header, key: str, where: str) -> int | None:
    value = card(header, key, where)
    if value is None or (isinstance(value, int) and not isinstance(value, bool)):
        return value
    raise BadInput(where, f"{key} must be an integer (got {value!r})")


def number(header: Header, key: str, where: str) -> float | None:
    """A finite number; anything else that is there is refused."""
    value = card(header, key, where)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
        raise BadInput(where, f"{key} must be a finite number (got {value!r})")
    try:
        return float(value)
    except OverflowError:
        raise BadInput(where, f"{key} must be a finite number (got one of {len(str(value))} digits)") from None


def text(header: Header, key: str, where: str) -> str:
    value = card(header, key, where)
    return "" if value is None else str(value).strip()


def image_facts(headers: tuple[Header, ...], where: str, file_name: str) -> ImageFacts:
    """Facts from the image header, then from the primary one."""
    notes: list[str] = []

    def first_text(*keys: str) -> str:
        found = (text(header, key, where) for header in headers for key in keys)
        return next((value for value in found if value), "")[:MAX_WORDS]

    def first_number(*keys: str) -> float | None:
        for header in headers:
            for key in keys:
                try:
                    value = number(header, key, where)
                except BadInput as error:
                    notes.append(f"{error}; ignored")
                    continue
                if value is not None:
                    return value
        return None

    exposure_s = first_number(*EXPOSURE_KEYS)
    if exposure_s is not None and not 0.0 < exposure_s <= MAX_EXPOSURE_S:
        limits = f"positive and at most {MAX_EXPOSURE_S:g} s"
        notes.append(f"{where}: the exposure time must be {limits} (got {exposure_s:g} s); ignored")
        exposure_s = None
    subspace_ev = _subspace_ev(first_text)
    low, high = _band(first_number, first_text("E_UNIT", "EUNIT"), subspace_ev, where, notes)
    return ImageFacts(
        file_name=file_name,
        exposure_s=exposure_s,
        energy_min_kev=low,
        energy_max_kev=high,
        telescope=first_text("TELESCOP"),
        instrument=first_text("INSTRUME"),
        filter_name=first_text("FILTER"),
        obs_id=first_text("OBS_ID"),
        object_name=first_text("OBJECT"),
        notes=tuple(notes),
    )


def _subspace_ev(first_text: Callable[..., str]) -> tuple[float | None, float | None]:
    """The selection PI = low:high of an XMM-Newton image (data-subspace cards DSTYPn, DSUNIn, DSVALn).

    Units are eV, or channels, which are 1 eV wide in EPIC and something else in other telescopes.
    """
    units = ("ev", "chan") if first_text("TELESCOP").upper() == "XMM" else ("ev",)
    for n in range(1, MAX_SUBSPACE_CARDS + 1):
        if first_text(f"DSTYP{n}") == "PI" and first_text(f"DSUNI{n}").casefold() in units:
            match = re.fullmatch(r"(\d+):(\d+)", first_text(f"DSVAL{n}"))
            return (float(match[1]), float(match[2])) if match else (None, None)
    return None, None


def _band(
    first_number: Callable[..., float | None],
    unit: str,
    subspace_ev: tuple[float | None, float | None],
    where: str,
    notes: list[str],
) -> tuple[float | None, float | None]:
    low, high = first_number("E_MIN", "EMIN"), first_number("E_MAX", "EMAX")
    in_ev = unit.casefold() == "ev" or (not unit and high is not None and high > MAX_PLAUSIBLE_KEV)
    if low is None or high is None:
        low, high, in_ev = first_number("PIMIN"), first_number("PIMAX"), True
    if low is None or high is None:
        low, high = subspace_ev
    if low is None or high is None:
        return None, None
    if in_ev:
        low, high = low / EV_PER_KEV, high / EV_PER_KEV
    if not 0.0 <= low < high:
        notes.append(f"{where}: the energy band must have 0 <= E_MIN < E_MAX (got {low:g} and {high:g} keV); ignored")
        return None, None
    return low, high
