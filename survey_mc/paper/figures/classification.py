"""Statistics that tell extended from point sources, against off-axis angle and counts.

Idea     a column of two panels for each statistic; the cloud of point-only fields in grey, identified sources over it.
Source   paper Figs. "test2:class1", "test2:class2", "test4:class".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.detect import DETECTORS
from survey_mc.detect.detector import R50, ExtentStatistic
from survey_mc.paper.figures.rows import FIRST, Procedure, column, matched_detections, thinned
from survey_mc.paper.figures.sheet import DASHED, GUIDE, PALE, handle, legend_below, sheet
from survey_mc.paper.results import StudyResults
from survey_mc.report.figures.panels import log_x
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

MARKS_MAX = 600  # small symbols behind the large ones
COUNTS_CUT = 20.0  # paper Sect. 7.3
REGION_ARCMIN = 10.0
OFFAXIS_MAX_ARCMIN = 15.5
COUNTS_LIMITS = (4.0, 4000.0)
LIMITS = {"r50_arcsec": (0.0, 62.0), "stellarity": (-0.05, 1.05), "PSFRATIO": (0.0, 3.0), "EXT_ML": (-0.3, 300.0),
          "EXTENT": (0.0, 16.0)}  # fmt: skip
MARKER_OF = {"point": "^", "extended": "o"}
POINT_COLOUR = "#222222"
UNIT = {"arcsec": "″", "pixel": " pixels"}


@dataclass(frozen=True, slots=True)
class Marked:
    """Identified sources of a kind, drawn over the cloud."""

    kind: str
    detections: DataFrame


@dataclass(frozen=True, slots=True)
class Panel:
    """One statistic of one procedure: the cloud of point-only fields and what is marked over it."""

    procedure: Procedure
    statistic: ExtentStatistic
    cloud: DataFrame
    marks: tuple[Marked, ...]


def statistic(name: str, column_name: str) -> ExtentStatistic:
    """The registered extent statistic of a procedure in a column."""
    known = (*DETECTORS[name].extent_statistics, R50)
    return next(s for s in known if s.column == column_name)


def found_of(results: StudyResults, campaign: str, label: str, kind: str) -> DataFrame:
    """Detections identified with true sources of a kind."""
    return matched_detections(results, campaign, label, kind)


def extent_panels(panels: Sequence[Panel]) -> list[Panel]:
    """The panels that have something to show."""
    return [p for p in panels if any(len(f) for f in (p.cloud, *(m.detections for m in p.marks)))]


def classification_figure(panels: Sequence[Panel]) -> Figure:
    """Off-axis angle above, counts below, a column for each statistic."""
    figure, grid = sheet(
        (2, len(panels)), (3.3 if len(panels) < 3 else 2.9, 2.25), margins=(0.65, 0.15, 0.3, 0.85), gaps=(0.62, 0.45)
    )
    for panel, (above, below) in zip(panels, grid.T, strict=True):
        above.set_title(f"{panel.procedure.label}: {panel.statistic.label}", loc="left", fontsize=8.5)
        for axes, against in ((above, "offaxis_arcmin"), (below, "counts")):
            _scatter(axes, panel, against)
            axes.axhline(panel.statistic.cut, color=GUIDE, ls=DASHED, lw=1.0, zorder=2)
            _statistic_axis(axes, panel.statistic)
        above.set(xlim=(0.0, OFFAXIS_MAX_ARCMIN), xlabel="off-axis angle (arcmin)")
        above.axvline(REGION_ARCMIN, color=GUIDE, ls=DASHED, lw=0.8, zorder=2)
        below.set_xlim(*COUNTS_LIMITS)
        log_x(below, as_powers=False)
        below.axvline(COUNTS_CUT, color=GUIDE, ls=DASHED, lw=0.8, zorder=2)
        below.set_xlabel("detected counts")
    legend_below(figure, _handles(panels))
    return figure


def _scatter(axes: Any, panel: Panel, against: str) -> None:
    cloud = thinned(panel.cloud)
    axes.scatter(column(cloud, against), _shown(panel, cloud), s=3.0, c=PALE, linewidths=0, rasterized=True, zorder=1)
    for mark in panel.marks:
        marker = MARKER_OF[mark.kind]
        colour = panel.procedure.look.colour if mark.kind == "extended" else POINT_COLOUR
        first = mark.detections["realisation"] == FIRST
        others = thinned(mark.detections[~first], MARKS_MAX)
        axes.scatter(
            column(others, against), _shown(panel, others), s=7.0, marker=marker, c=colour, alpha=0.35, linewidths=0,
            rasterized=True, zorder=3,
        )  # fmt: skip
        image = mark.detections[first]
        axes.scatter(
            column(image, against), _shown(panel, image), s=34.0, marker=marker,
            c=colour if mark.kind == "extended" else "white", edgecolors="#222222", linewidths=0.9, zorder=4,
        )  # fmt: skip


def _shown(panel: Panel, frame: DataFrame) -> FloatArray:
    """The statistic, held inside the axis so that nothing disappears."""
    low, high = LIMITS[panel.statistic.column]
    values = column(frame, panel.statistic.column)
    return np.clip(values, low, high)


def _statistic_axis(axes: Any, wanted: ExtentStatistic) -> None:
    low, high = LIMITS[wanted.column]
    if wanted.column == "EXT_ML":
        axes.set_yscale("symlog", linthresh=1.0, linscale=0.6)
        axes.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    room = 0.03 * (high - low) if wanted.column != "EXT_ML" else 0.2 * high
    axes.set_ylim(low - (0.0 if low >= 0.0 else 0.02), high + room)
    unit = f" ({UNIT.get(wanted.unit, wanted.unit).strip()})" if wanted.unit else ""
    name = {"r50_arcsec": "R50"}.get(wanted.column, wanted.column)
    axes.set_ylabel(f"{name}{unit}")


def _handles(panels: Sequence[Panel]) -> list[Any]:
    colour = panels[0].procedure.look.colour if len({p.procedure.name for p in panels}) == 1 else GUIDE
    kinds = {mark.kind for panel in panels for mark in panel.marks}
    entries = [handle("point-only fields", marker="o", ls="none", ms=3.0, color=PALE)]
    if "point" in kinds:
        entries.append(handle("point sources", marker="^", ls="none", ms=6.0, mfc="white", mec="#222222"))
    if "extended" in kinds:
        entries.append(handle("extended sources", marker="o", ls="none", ms=6.0, mfc=colour, mec="#222222"))
    entries.append(handle("cuts", color=GUIDE, ls=DASHED, lw=1.0))
    return entries
