"""The columns of the scorecard's tables: name, type, unit, meaning."""

from __future__ import annotations

from survey_mc.columns import Column, Table
from survey_mc.paper.verdict import SHORT_RULE


def _text(name: str, about: str) -> Column:
    return Column(name, "string", about)


def _number(name: str, about: str) -> Column:
    return Column(name, "float64", f"{about}, in the row's unit")


CLAIM = _text("id", "the published fact")
MEDIAN = _number("median", "median of our values")
LOWER_68, UPPER_68 = (_number(f"{end}_68", f"{end} end of their central 68.27 %") for end in ("lower", "upper"))
LOWER_95, UPPER_95 = (_number(f"{end}_95", f"{end} end of their central 95 %") for end in ("lower", "upper"))
N = Column("n", "int64", "our values: single images or drawn groups with a value, 1 for a constant, 0 for none")
PERCENTILE = Column("percentile", "float64", "rank of the published value among ours, 0 to 100; NaN for a constant")
VERDICT = _text("verdict", "reproduced, differs or not comparable")

SCORECARD = Table("scorecard", f"Every published number beside ours. Rule: {SHORT_RULE}", (
    CLAIM,
    _text("where", "table or section of the paper"),
    _text("quantity", "what was published"),
    _text("method", "procedures, by registered name; empty: none or all"),
    _text("condition", "for what it was published"),
    _text("published", "the value as printed, or in a word"),
    _text("unit", "unit of the published value and of ours; empty: a plain number"),
    _text("statistic", "what was computed from our fields"),
    _text("sampling", "what our values are: single images, groups of ten fields, computed; empty: none"),
    N,
    MEDIAN,
    LOWER_68,
    UPPER_68,
    LOWER_95,
    UPPER_95,
    PERCENTILE,
    VERDICT,
    _text("reason", "why this verdict"),
    _text("cause", "where it differs: the named option that explains it best"),
    _number("cause_median", "median under that option"),
    _text("cause_verdict", "verdict under that option"),
    _text("effect", "explains, explains in part, none found or not measured"),
    _text("note", "what to know of the published value"),
))  # fmt: skip

OPTION_EFFECTS = Table("option_effects", f"Every published number under every named option. Rule: {SHORT_RULE}", (
    CLAIM,
    _text("option", "named option, one at a time"),
    _text("about", "what it means"),
    N,
    MEDIAN,
    LOWER_68,
    UPPER_68,
    PERCENTILE,
    VERDICT,
    Column("share", "float64", "part of the distance from our base median to the published value that it removes; "
           "1: all, negative: it adds; NaN if there is no distance"),
))  # fmt: skip

CPU_TABLE = Table("cpu_table", "Cost of one deep soft field, 100 ks; of the machine, not of the study", (
    _text("method", "procedure"),
    Column("paper_minutes", "float64", "published CPU time (Tab. 9, Pentium III, 550 MHz)", "min"),
    Column("paper_ratio", "float64", "published time over that of mr1_se"),
    Column("n_fields", "int64", "our fields"),
    Column("cpu_s_per_field", "float64", "our CPU time of detection, mean", "s"),
    Column("ratio", "float64", "our time over that of mr1_se"),
))  # fmt: skip
