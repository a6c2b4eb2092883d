"""From a run to what a person reads: aggregated tables, figures and one HTML page."""

from survey_mc.report.build import build_report
from survey_mc.report.make import current_report, make_report, remake_report
from survey_mc.report.source import FieldPicture, RunSource
from survey_mc.report.table_columns import CPU_SECONDS, TABLES
from survey_mc.report.tables import build_tables

REPORT_TABLES = (*TABLES, CPU_SECONDS)

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
