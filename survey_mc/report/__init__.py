"""From a run to what a person reads: aggregated tables, figures and one HTML page.

The names below load what they need when they are first used: to see that a report is as new as its run takes no tables.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from survey_mc.lazy_names import lazy_names

if TYPE_CHECKING:
    from survey_mc.report.build import build_report
    from survey_mc.report.current import current_report
    from survey_mc.report.make import make_report, remake_report
    from survey_mc.report.source import FieldPicture, RunSource
    from survey_mc.report.table_columns import REPORT_TABLES
    from survey_mc.report.tables import build_tables

_HOMES = {
    "REPORT_TABLES": "table_columns",
    "FieldPicture": "source",
    "RunSource": "source",
    "build_report": "build",
    "build_tables": "tables",
    "current_report": "current",
    "make_report": "make",
    "remake_report": "make",
}

__getattr__ = lazy_names(__name__, _HOMES)

__all__ = [
    "REPORT_TABLES",
    "FieldPicture",
    "RunSource",
    "build_report",
    "build_tables",
    "current_report",
    "make_report",
    "remake_report",
]


def __dir__() -> list[str]:
    return sorted(__all__)
