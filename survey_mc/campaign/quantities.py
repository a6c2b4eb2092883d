"""Numbers given as text with a unit.

Idea     a key says its unit (`radius_arcsec`); its value may still be a text such as "0.1 arcmin" or "10 ks", which is
         converted to that unit before anything else looks at it. A text with a unit of another kind is refused.
Limits   lists, tables and numbers that no campaign needs are refused here, before any model multiplies them.
"""

from __future__ import annotations

import re
from datetime import date, time
from typing import Any

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.fits.unit_text import unit_from_text

MAX_NESTING = 32
MAX_ENTRIES = 1000  # of one list or table
INTEGERS = range(-(2**63), 2**63)  # TOML 1.0: what every reader must keep
MAX_SHOWN = 200  # characters of a place in an error sentence
MAX_KEY = 80  # of one key in it
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII)

_UNITS = {
    "_arcsec": ("arcsec", "an angle"),
    "_arcmin": ("arcmin", "an angle"),
    "_deg": ("deg", "an angle"),
    "_ks": ("ks", "a time"),
    "_s": ("s", "a time"),
    "_kev": ("keV", "an energy"),
    "_kpc": ("kpc", "a length"),
    "_cgs": ("erg / (s cm2)", "a flux"),
    "_cps": ("ct / s", "a count rate"),
}


def convert_quantities(value: Any, where: str, key: str = "", path: str = "") -> Any:
    """The same TOML value with every text under a key with a unit suffix turned into a number in that unit.

    where: the file; path: the place inside it, for the error sentence. Dates and times, which no key takes, integers
    of more than 64 bits, and tables and lists larger or deeper than any campaign's are refused here.
    """
    if path.count(".") + path.count("[") > MAX_NESTING:
        raise BadInput(f"{where}: {path[:MAX_SHOWN]}", f"is nested more than {MAX_NESTING} levels deep")
    if isinstance(value, date | time):
        raise BadInput(f"{where}: {path[:MAX_SHOWN]}", f"must not be a date or a time (got {value})")
    if isinstance(value, dict | list) and len(value) > MAX_ENTRIES:
        place = path[:MAX_SHOWN] or "top level"
        raise BadInput(
            f"{where}: {place}",
            f"must have at most {MAX_ENTRIES} entries (got {len(value)}, the first {_first(value)})",
        )
    if isinstance(value, dict):
        return {
            k: convert_quantities(v, where, k, f"{path}.{shown_key(k)}" if path else shown_key(k))
            for k, v in value.items()
        }
    if isinstance(value, list):
        return [convert_quantities(v, where, key, f"{path}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, int) and value not in INTEGERS:
        raise BadInput(f"{where}: {path[:MAX_SHOWN]}", "must be an integer of 64 bits (got a larger one)")
    suffix = next((s for s in _UNITS if key.endswith(s)), None)
    if isinstance(value, str) and suffix is not None:
        return _number(value, suffix, f"{where}: {path[:MAX_SHOWN]}")
    return value


def shown_key(key: str) -> str:
    """A key as an error sentence shows it: quoted where TOML would have to quote it."""
    return key[:MAX_KEY] if _BARE_KEY.fullmatch(key) else repr(key[:MAX_KEY])


def _first(value: dict[str, Any] | list[Any]) -> str:
    return repr(next(iter(value)))[:60]


def _number(text: str, suffix: str, where: str) -> float:
    from astropy import units as u

    unit_name, kind = _UNITS[suffix]
    problem = f'must be {kind}: a number in {unit_name}, or a text like "3 {unit_name}" (got {text[:60]!r})'
    parts = _NUMBER_AND_UNIT.fullmatch(text[:MAX_SHOWN])
    if parts is None or len(text) > MAX_SHOWN:
        raise BadInput(where, problem)
    try:
        # numpy warns of what is infinite; the model that takes the number refuses it
        with np.errstate(over="ignore"):
            return float(u.Quantity(float(parts[1]), unit_from_text(parts[2])).to_value(u.Unit(unit_name)))
    except (u.UnitsError, TypeError, ValueError, ArithmeticError):
        raise BadInput(where, problem) from None
