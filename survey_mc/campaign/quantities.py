"""Numbers given as text with a unit.

Idea     a key says its unit (`radius_arcsec`); its value may still be a text such as "0.1 arcmin" or "10 ks", which is
         converted to that unit before anything else looks at it. A text with a unit of another kind is refused.
"""

from __future__ import annotations

from datetime import date, time
from typing import Any

from survey_mc.errors import BadInput

MAX_NESTING = 32

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

    where: the file; path: the place inside it, for the error sentence. Dates and times, which no key takes, and tables
    nested deeper than any campaign are refused here.
    """
    if path.count(".") + path.count("[") > MAX_NESTING:
        raise BadInput(where, f"is nested more than {MAX_NESTING} levels deep")
    if isinstance(value, date | time):
        raise BadInput(f"{where}: {path[:200]}", f"must not be a date or a time (got {value})")
    if isinstance(value, dict):
        return {
            k: convert_quantities(v, where, k if isinstance(k, str) else "", f"{path}.{k}" if path else str(k))
            for k, v in value.items()
        }
    if isinstance(value, list):
        return [convert_quantities(v, where, key, f"{path}[{i}]") for i, v in enumerate(value)]
    suffix = next((s for s in _UNITS if key.endswith(s)), None)
    if isinstance(value, str) and suffix is not None:
        return _number(value, suffix, f"{where}: {path}")
    return value


def _number(text: str, suffix: str, where: str) -> float:
    from astropy import units as u

    unit_name, kind = _UNITS[suffix]
    problem = f'must be {kind}: a number in {unit_name}, or a text like "3 {unit_name}" (got {text[:60]!r})'
    try:
        quantity = u.Quantity(text[:80])
        converted = float(quantity.to_value(u.Unit(unit_name)))
    except (u.UnitsError, TypeError, ValueError):
        raise BadInput(where, problem) from None
    return converted
