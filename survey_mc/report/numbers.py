"""Numbers for people: as many digits as their interval deserves."""

from __future__ import annotations

import math

DASH = "–"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain(value: float, digits: int = 3) -> str:
    """Up to `digits` significant digits; a dash for what is not known."""
    if not math.isfinite(value):
        return "∞" if value == math.inf else DASH
    if value == 0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(decimals, 6)}f}"


def power(value: float, lower: float = math.nan, upper: float = math.nan) -> tuple[str, str]:
    """A small number and its interval in the same power of ten: "1.67 × 10⁻¹⁵" and "1.59 … 1.78"."""
    if not (math.isfinite(value) and value > 0):
        return DASH, ""
    exponent = math.floor(math.log10(value))
    scale = 10.0**exponent
    return f"{value / scale:.2f} × 10{str(exponent).translate(SUPERSCRIPT)}", between(lower / scale, upper / scale)


def with_interval(value: float, lower: float, upper: float) -> tuple[str, str]:
    """A number and its interval: "2.33" and "1.72 … 3.14"."""
    return (plain(value), between(lower, upper)) if math.isfinite(value) else (DASH, "")


def between(lower: float, upper: float) -> str:
    """An interval, an open end as 0 or ∞; nothing if it is not known."""
    return "" if math.isnan(lower) or math.isnan(upper) else f"{plain(lower)} … {plain(upper)}"
