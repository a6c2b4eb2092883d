"""Columns that the aggregated tables share, and makers of columns of one kind."""

from __future__ import annotations

from survey_mc.columns import Column

FLUX = "erg / (s cm2)"

CELL = Column("cell", "string", "combination of the campaign's grid", ucd="meta.id")
BAND = Column("band", "string", "energy band", ucd="instr.bandpass")
EXPOSURE = Column("exposure_ks", "float64", "exposure on axis", "ks", "time.duration;obs.exposure")
METHOD = Column("method", "string", "label of the method in the campaign", ucd="meta.id")
RULE = Column("rule", "string", "matching rule: nearest (position) or origin (photons)")
N_FIELDS = Column("n_fields", "int64", "fields summed", ucd="meta.number")
KIND = Column("kind", "string", "true sources: all; point and extended besides, where a cell has both", ucd="src.class")
IDENTITY = (CELL, BAND, EXPOSURE, METHOD, RULE, N_FIELDS)


def number(name: str, about: str) -> Column:
    return Column(name, "int64", about, ucd="meta.number")


def value(name: str, about: str, unit: str = "", ucd: str = "") -> Column:
    return Column(name, "float64", about, unit, ucd)


def rate(name: str, about: str, unit: str) -> tuple[Column, ...]:
    """A value and its exact Poisson interval."""
    return (
        value(name, about, unit),
        value(f"{name}_lower", f"lower end of {name} (Garwood, 68.27 %)", unit),
        value(f"{name}_upper", f"upper end of {name} (Garwood, 68.27 %)", unit),
    )


def fraction(name: str, about: str, what: str = "") -> tuple[Column, ...]:
    """A fraction, its Jeffreys interval, the one from resampled fields and the design effect; what: their subject."""
    subject = what or name
    return (
        value(name, about),
        value(f"{name}_lower", f"lower end of {subject} (Jeffreys, 68.27 %)"),
        value(f"{name}_upper", f"upper end of {subject} (Jeffreys, 68.27 %)"),
        value(f"{name}_lower_fields", f"lower end of {subject} from resampled fields; NaN for a single field"),
        value(f"{name}_upper_fields", f"upper end of {subject} from resampled fields; NaN for a single field"),
        value(f"{name}_design_effect", "variance between fields over the binomial one; NaN where unknown"),
    )
