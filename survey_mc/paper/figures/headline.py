"""The study in one picture: what is found at each flux, and what is made up.

Source   paper Sect. 8 and Tab. "test5" for the published limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import CHOSEN, Procedure, cell, fields_phrase, matches, procedures
from survey_mc.paper.figures.sheet import FLUX_LABEL, drawing, handle, legend_below, note, sheet
from survey_mc.paper.figures.test5_completeness import (
    BAND_KEV,
    BINS,
    found_fraction,
    limit_text,
    procedure_handles,
    rate_axes,
    rate_curve,
)
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_5
from survey_mc.stats.false_detections import FALSE_STATUSES
from survey_mc.store import CellRecord

BAND = "soft"
EXPOSURES_KS = (10.0, 100.0)
FLUX_LIMITS = (1.6e-16, 2.9e-14)
BAR_HEIGHT = 0.36


def headline_figure(results: StudyResults) -> PaperFigure:
    """Completeness of all procedures at both exposures, false detections beside it."""
    cells = [cell(results, TEST_5, BAND, ks) for ks in EXPOSURES_KS]
    shown = procedures(results, TEST_5)
    with drawing():
        figure, grid = sheet((1, 3), (3.35, 2.9), margins=(0.65, 0.15, 0.32, 0.85), gaps=(0.2, 0.2))
        for axes, record in zip(grid[0], cells, strict=False):
            rate_axes(axes, record)
            axes.set_xlim(*FLUX_LIMITS)
            for chosen in shown:
                found = matches(results, TEST_5, chosen.label, record.label)
                rate_curve(axes, found_fraction(found, BINS, record.realisations), chosen, zorder=3)
            axes.set_xlabel(f"true {FLUX_LABEL}")
            for chosen in (p for p in shown if p.name == CHOSEN):
                text = f"{chosen.label}: {limit_text(results, chosen, record)}"
                note(axes, 0.98, 0.05, text, ha="right", va="bottom", color=chosen.look.colour, fontsize=7.5)
        grid[0][0].set_ylabel("found / input")
        grid[0][1].tick_params(labelleft=False)
        _move_right(grid[0][2], figure)
        _false_bars(grid[0][2], results, shown, cells)
        mark = handle("paper's 90 % limit, MR/1+SE", marker="v", ls="none", ms=7.0, mfc="white", mec="#222222")
        legend_below(figure, [*procedure_handles(shown), mark], 7)
    return PaperFigure(
        "headline",
        "Found and made up, six procedures",
        f"Left, middle: fraction of the input sources found against true flux, {BAND_KEV[BAND]}, inside 10′, mean of "
        f"{fields_phrase(results.n_fields(TEST_5))} of {TEST_5} for each exposure; dotted: 90 %; triangle: 90 % limit "
        "published for MR/1+SE by Valtchanov, Pierre & Gastaud 2001. Right: detections without an input source above "
        "the count limit, per field; full colour: those that rest on no source; pale: blends and faint sources.",
        figure,
    )


def false_per_field(results: StudyResults, label: str, record: CellRecord) -> tuple[float, float]:
    """Detections per field inside the region: fluctuations alone, and all without a listed input."""
    status = matches(results, TEST_5, label, record.label)["status"]
    n = record.realisations
    return float((status == "spurious").sum()) / n, float(status.isin(FALSE_STATUSES).sum()) / n


def _false_bars(axes: Any, results: StudyResults, shown: Sequence[Procedure], cells: Sequence[CellRecord]) -> None:
    """For each procedure a bar for each exposure, the deeper one below."""
    longest = 1.0
    for place, chosen in enumerate(shown):
        for nth, record in enumerate(cells):
            noise, false = false_per_field(results, chosen.label, record)
            height = place + (nth - 0.5) * BAR_HEIGHT
            colour = chosen.look.colour
            axes.barh(height, false, height=0.9 * BAR_HEIGHT, color=colour, alpha=0.35)
            axes.barh(height, noise, height=0.9 * BAR_HEIGHT, color=colour)
            axes.annotate(f"{false:.1f}  ({record.exposure_ks:g} ks)", (false, height), (3, 0),
                          textcoords="offset points", va="center", fontsize=7.0)  # fmt: skip
            longest = max(longest, false)
    axes.set(xlim=(0.0, 1.4 * longest), ylim=(len(shown) - 0.4, -0.6))
    axes.set_yticks(range(len(shown)), [p.label for p in shown])
    axes.grid(axis="y", visible=False)
    axes.set_title("false detections", loc="left")
    axes.set_xlabel("per field, inside 10′")
    note(
        axes,
        0.98,
        0.04,
        "full colour: on no source\npale: blends, sources\nbelow the count limit",
        ha="right",
        va="bottom",
    )


def _move_right(axes: Any, figure: Any) -> None:
    """Room for the names of the procedures left of the last panel."""
    place = axes.get_position()
    shift = 0.82 / figure.get_size_inches()[0]
    axes.set_position((place.x0 + shift, place.y0, place.width - shift, place.height))
