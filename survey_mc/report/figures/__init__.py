"""All figures of a report, from its tables alone; matplotlib is imported here, when the first one is drawn."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from survey_mc.report.figures.classification import classification_figure
from survey_mc.report.figures.completeness import completeness_figure
from survey_mc.report.figures.counts import differential_figure, integral_figure
from survey_mc.report.figures.measures import cost_figure, false_figure, photometry_figure, position_figure
from survey_mc.report.figures.pictures import field_figures
from survey_mc.report.figures.style import Figure, looks
from survey_mc.report.source import RunSource

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["Figure", "field_figures", "looks", "run_figures"]


def run_figures(source: RunSource, tables: Mapping[str, DataFrame]) -> list[Figure]:
    """The figures of a run in the order of the report; those without any numbers are left out."""
    figures = []
    for figure in _candidates(source, tables):
        gc.collect()  # what matplotlib draws on refers to itself, and a picture is 10 MB
        if figure is not None:
            figures.append(figure)
    return figures


def _candidates(source: RunSource, tables: Mapping[str, DataFrame]) -> Iterator[Figure | None]:
    cells, look = source.cells, looks(source.methods)
    rule = cells[0].rule if cells else "nearest"
    for quantity in ("flux_true_cgs", "counts_expected"):
        yield from _by_kind(
            tables["completeness"], partial(completeness_figure, cells=cells, look=look, rule=rule, quantity=quantity)
        )
    yield false_figure(tables["false_detections"], cells, look, rule)
    for cell in cells:
        yield differential_figure(tables["counts_differential"], cell, look, rule)
    yield integral_figure(tables["counts_integral"], cells, look, rule)
    for by in ("counts", "flux"):
        yield from _by_kind(tables["photometry"], partial(photometry_figure, cells=cells, look=look, rule=rule, by=by))
    yield from _by_kind(tables["astrometry"], partial(position_figure, cells=cells, look=look, rule=rule))
    yield classification_figure(tables["classification_curve"], tables["classification"], cells, look, rule)
    yield cost_figure(tables["cpu_seconds"], cells, look)


def _by_kind(table: DataFrame, draw: Callable[[DataFrame], Figure | None]) -> Iterator[Figure | None]:
    """One figure, or one of the point and one of the extended sources where a cell has both."""
    extended = table[table["kind"] == "extended"]
    if not len(extended):
        yield draw(table)
        return
    point = table[(table["kind"] == "point") | ((table["kind"] == "all") & ~table["cell"].isin(extended["cell"]))]
    for kind, rows in (("point", point), ("extended", extended)):
        figure = draw(rows)
        yield figure and replace(
            figure,
            name=f"{figure.name}_{kind}",
            title=f"{figure.title}, {kind} sources",
            caption=f"{kind.capitalize()} sources only. {figure.caption}",
        )
