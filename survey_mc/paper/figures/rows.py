"""The stored rows a figure needs, by procedure: matches, detections, truth, and their joins.

Idea     a procedure may have found nothing, or a campaign may have one field only: every function gives a frame with
         its columns, with no rows where there is nothing.
Limits   clouds of points are thinned to a fixed number by taking every n-th row, the same ones every time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.columns import DETECTIONS, LINKS, MATCHES, TRUTH, Table
from survey_mc.paper.results import StudyResults
from survey_mc.report.figures.style import Look, looks
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.store import CellRecord

CHOSEN = "mr1_se"  # the procedure that the paper chooses and shows alone
RIVAL = "emldetect"  # the one it is compared with
POINTS_MAX = 3000  # of a cloud; more only make a file large
FIRST = 0  # the realisation that stands for the paper's single image


@dataclass(frozen=True, slots=True)
class Procedure:
    """A procedure of a campaign: its registered name, its label there, and how it looks in every figure."""

    name: str
    label: str
    look: Look


def procedures(results: StudyResults, campaign: str) -> tuple[Procedure, ...]:
    """The procedures of a campaign, in its order."""
    methods = results.run(campaign).data.methods
    look = looks(methods)
    return tuple(Procedure(method.name, method.label, look[method.label]) for method in methods)


def procedure(results: StudyResults, campaign: str, name: str) -> Procedure | None:
    """The first procedure of that registered name, None if the campaign has none."""
    return next((p for p in procedures(results, campaign) if p.name == name), None)


def cell(results: StudyResults, campaign: str, band: str = "soft", exposure_ks: float | None = None) -> CellRecord:
    """The first cell of a band (and exposure) of a campaign; the first of all if there is none of that kind."""
    cells = results.run(campaign).data.cells
    fitting = (c for c in cells if c.band == band and exposure_ks in (None, c.exposure_ks))
    return next(fitting, cells[0])


def matches(results: StudyResults, campaign: str, label: str, cell_label: str | None = None) -> DataFrame:
    """Matches by the rule of the campaign."""
    record = results.run(campaign).data.cell(cell_label or results.run(campaign).cells[0])
    return _with_columns(results.matches(campaign, label, record.rule, record.label), MATCHES)


def detections(results: StudyResults, campaign: str, label: str, cell_label: str | None = None) -> DataFrame:
    """Detections with the procedure's own columns."""
    return _with_columns(results.detections(campaign, label, cell_label), DETECTIONS)


def truth(results: StudyResults, campaign: str, cell_label: str | None = None) -> DataFrame:
    """True sources."""
    return _with_columns(results.truth(campaign, cell_label), TRUTH)


def links(results: StudyResults, campaign: str, label: str, cell_label: str | None = None) -> DataFrame:
    """Candidate pairs."""
    return _with_columns(results.links(campaign, label, cell_label), LINKS)


def matched_detections(results: StudyResults, campaign: str, label: str, kind: str) -> DataFrame:
    """Detections identified with true sources of a kind ("point" or "extended"), with their own columns."""
    found = matches(results, campaign, label)
    found = found.loc[(found["status"] == "matched") & (found["kind_true"] == kind), ["realisation", "det_id"]]
    return detections(results, campaign, label).merge(found, on=["realisation", "det_id"], validate="one_to_one")


def column(frame: DataFrame, name: str) -> FloatArray:
    """A column as numbers, NaN where the procedure does not have it."""
    if name not in frame:
        return np.full(len(frame), np.nan)
    return np.asarray(frame[name], dtype=np.float64)


def thinned(frame: DataFrame, n_max: int = POINTS_MAX) -> DataFrame:
    """At most n_max rows, evenly spread over the frame."""
    if len(frame) <= n_max:
        return frame
    return frame.iloc[np.linspace(0, len(frame) - 1, n_max).astype(np.int64)]


def mean_text(values: Sequence[float] | FloatArray) -> str:
    """Mean and sample standard deviation in the manner of the paper: "0.95 (0.12)"; both 0 where there is nothing."""
    ratios = np.asarray(values, dtype=np.float64)
    ratios = ratios[np.isfinite(ratios)]
    mean = ratios.mean() if ratios.size else 0.0
    spread = ratios.std(ddof=1) if ratios.size > 1 else 0.0
    return f"{mean:.2f} ({spread:.2f})"


def fields_phrase(n: int, noun: str = "field") -> str:
    """ "1 image" or "200 images"."""
    return f"{n} {noun}{'' if n == 1 else 's'}"


def _with_columns(frame: DataFrame, table: Table) -> DataFrame:
    return frame if len(frame.columns) else frame.reindex(columns=list(table.names))
