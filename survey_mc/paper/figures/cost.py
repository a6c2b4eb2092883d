"""What the procedures cost: CPU time of the deep fields, ours and the paper's.

Idea     machines are a quarter of a century apart; what can be compared is the cost relative to MR/1+SE.
Source   paper Tab. "cpu": minutes on a 550 MHz Pentium III for one field of Test 5, 100 ks, 0.5-2 keV.
Limits   ours is the median over tasks of CPU seconds per field: the first tasks also compile or load code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.paper.claims import published_number
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import CHOSEN, Procedure, cell, detections, fields_phrase, procedures
from survey_mc.paper.figures.sheet import GUIDE, drawing, handle, legend_below, sheet
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_5
from survey_mc.report.figures.panels import log_x
from survey_mc.report.numbers import DASH, plain

if TYPE_CHECKING:
    from survey_mc.store import CellRecord

SECONDS_PER_MINUTE = 60.0
BAR_HEIGHT = 0.36
DETECTIONS_TITLE = "detections per image"
PAPER_BAR: dict[str, Any] = {"facecolor": "white", "edgecolor": "#444444", "hatch": "////", "linewidth": 0.8}


@dataclass(frozen=True, slots=True)
class Cost:
    """CPU seconds of one field and detections on the whole image, ours (means over fields) and the paper's."""

    procedure: Procedure
    ours_s: float
    paper_s: float
    ours_detections: float
    paper_detections: float


def cost_of(results: StudyResults, record: CellRecord, chosen: Procedure) -> Cost:
    """Cost of a procedure in a cell of Test 5; NaN for what is not known."""
    journal = results.run(TEST_5).data.journal()
    rows = journal[
        (journal["cell"] == record.label)
        & (journal["method"] == chosen.label)
        & (journal["stage"] == "detect")
        & (journal["fields"] > 0)
    ]
    per_field = (rows["cpu_s"] / rows["fields"]).to_numpy(np.float64)
    return Cost(
        chosen,
        float(np.median(per_field)) if per_field.size else float("nan"),
        (published_number(f"cpu.{chosen.name}.minutes") or float("nan")) * SECONDS_PER_MINUTE,
        len(detections(results, TEST_5, chosen.label, record.label)) / record.realisations,
        published_number(f"cpu.{chosen.name}.n_det") or float("nan"),
    )


def cost_figure(results: StudyResults) -> PaperFigure:
    """CPU seconds, the same over those of MR/1+SE, and numbers of detections, as bars with their numbers."""
    record = cell(results, TEST_5, "soft", max(c.exposure_ks for c in results.run(TEST_5).data.cells))
    costs = [cost_of(results, record, p) for p in procedures(results, TEST_5)]
    base = next((c for c in costs if c.procedure.name == CHOSEN), None)
    columns = [
        ("CPU seconds per field", [(c.ours_s, c.paper_s) for c in costs]),
        ("CPU time / that of MR/1+SE", [_over(c, base) for c in costs]),
        (DETECTIONS_TITLE, [(c.ours_detections, c.paper_detections) for c in costs]),
    ]
    with drawing():
        figure, grid = sheet((1, 3), (2.75, 2.9), margins=(1.0, 0.2, 0.32, 0.72), gaps=(0.25, 0.2), share_y=True)
        for axes, (title, values) in zip(grid[0], columns, strict=True):
            _bars(axes, costs, values, is_log=title != DETECTIONS_TITLE)
            axes.set_title(title, loc="left")
        axes = grid[0][0]
        axes.set_yticks(range(len(costs)), [c.procedure.label for c in costs])
        axes.set_ylim(len(costs) - 0.4, -0.6)
        legend_below(figure, [handle("ours", color=GUIDE, lw=7.0), _paper_patch()])
    return PaperFigure(
        "cost",
        "What the procedures cost",
        f"The paper's Tab. 9. CPU time of filtering and detection of one field of {TEST_5} (0.5-2 keV, "
        f"{record.exposure_ks:g} ks), its ratio to that of MR/1+SE, and detections on the whole image. Ours: median "
        f"over tasks, {fields_phrase(record.realisations)}, one core of the machine the study ran on; the paper's: a "
        "550 MHz Pentium III. Only the ratios compare procedures, and ours are other programs. The paper gives for "
        "EMLDETECT the number of input objects of the fit instead of the detections.",
        figure,
    )


def _over(cost: Cost, base: Cost | None) -> tuple[float, float]:
    """Ratios to the chosen procedure, NaN without it."""
    return (cost.ours_s / base.ours_s, cost.paper_s / base.paper_s) if base else (float("nan"), float("nan"))


def _bars(axes: Any, costs: Sequence[Cost], values: Sequence[tuple[float, float]], is_log: bool) -> None:
    """Two bars for each procedure, with their numbers at the end."""
    known = [v for pair in values for v in pair if np.isfinite(v) and v > 0.0]
    low, high = (min(known) / 4.0, max(known) * 8.0) if known else (0.1, 10.0)
    if is_log:
        axes.set(xscale="log", xlim=(low, high))
        log_x(axes, as_powers=False)
    else:
        low = 0.0
        axes.set_xlim(low, 0.16 * high)
    for place, (cost, (ours, paper)) in enumerate(zip(costs, values, strict=True)):
        for value, shift, style in ((ours, -1.0, {"facecolor": cost.procedure.look.colour}), (paper, 1.0, PAPER_BAR)):
            height = place + shift * BAR_HEIGHT / 2.0
            is_known = np.isfinite(value) and value > 0.0
            if is_known:
                axes.barh(height, value - low, left=low, height=BAR_HEIGHT, **style)
            text = plain(value) if is_known else DASH
            axes.annotate(text, (value if is_known else low, height), (3, 0), textcoords="offset points", va="center",
                          fontsize=7.5)  # fmt: skip
    axes.grid(axis="y", visible=False)


def _paper_patch() -> Any:
    from matplotlib.patches import Patch

    return Patch(label="the paper", **PAPER_BAR)
