"""The sheet a figure is drawn on: a grid of panels of fixed size in inches, and what all sheets share.

Idea     the layout is fixed in inches: letting matplotlib fit it takes longer than the drawing, and a panel keeps its
         size whatever its labels say.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from survey_mc.report.figures.style import SETTINGS
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SMALL_FONT = 7.0
GUIDE = "#777777"  # lines of reference
PALE = "#b9b9b9"  # clouds in the background
DASHED: Any = (0, (4, 3))
DOTTED: Any = (0, (1, 2))
FLUX_LABEL = "flux (erg cm⁻² s⁻¹)"
INPUT_COUNTS_LABEL = "input counts (rate × exposure)"

Share = bool | Literal["none", "all", "row", "col"]


def drawing() -> AbstractContextManager[None]:
    """The settings under which a figure is made and written."""
    import matplotlib as mpl

    return mpl.rc_context(SETTINGS)


def sheet(
    shape: tuple[int, int],
    panel_inches: tuple[float, float],
    *,
    margins: tuple[float, float, float, float] = (0.65, 0.15, 0.3, 0.8),
    gaps: tuple[float, float] = (0.2, 0.25),
    heights: Sequence[float] | None = None,
    share_x: Share = False,
    share_y: Share = False,
) -> tuple[Figure, Any]:
    """A figure and its (rows, columns) axes.

    margins: left, right, top, bottom (inches). gaps: between columns and rows (inches). heights: relative heights of
    the rows, whose mean is the panel's height.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    (n_rows, n_columns), (wide, high) = shape, panel_inches
    left, right, top, bottom = margins
    width = left + n_columns * wide + (n_columns - 1) * gaps[0] + right
    height = top + n_rows * high + (n_rows - 1) * gaps[1] + bottom
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    grid = figure.subplots(
        n_rows, n_columns, squeeze=False, sharex=share_x, sharey=share_y,
        gridspec_kw={"height_ratios": heights} if heights is not None else None,
    )  # fmt: skip
    figure.subplots_adjust(
        left / width, bottom / height, 1.0 - right / width, 1.0 - top / height,
        wspace=gaps[0] / wide, hspace=gaps[1] / high,
    )  # fmt: skip
    return figure, grid


def legend_below(figure: Any, handles: Iterable[Any], n_columns: int = 6) -> None:
    """One legend for all panels, in the bottom margin."""
    shown = list(handles)
    figure.legend(handles=shown, loc="lower center", ncols=min(n_columns, len(shown)), fontsize=8.0, columnspacing=1.4)


def handle(label: str, **style: Any) -> Any:
    """An entry of a legend: a line, or a marker where ls is "none"."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **style)


def note(axes: Any, x: float, y: float, text: str, **style: Any) -> None:
    """Small text at a place given in fractions of the panel, readable over what is drawn there."""
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}
    axes.text(
        x, y, text, transform=axes.transAxes, zorder=20, **{"fontsize": SMALL_FONT, "va": "top", "bbox": box, **style}
    )


def positive(values: Any) -> FloatArray:
    """Values for a logarithmic axis: zero has no place on it."""
    numbers = np.asarray(values, dtype=np.float64)
    return np.where(numbers > 0.0, numbers, np.nan)


def equality_lines(axes: Any, low: float, high: float) -> None:
    """The line of equality, and those of twice and half."""
    ends = np.array([low, high])
    axes.plot(ends, ends, color=GUIDE, lw=1.0, zorder=1)
    for factor in (0.5, 2.0):
        axes.plot(ends, factor * ends, color=GUIDE, lw=0.8, ls=DASHED, zorder=1)
