"""A grid of panels, one for each cell, with one legend for all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.report.figures.style import SETTINGS, literal, png_of
from survey_mc.report.numbers import SUPERSCRIPT
from survey_mc.report.source import CellLike

if TYPE_CHECKING:
    from pandas import DataFrame

PANEL_INCHES = (3.95, 2.6)
LONE_PANEL_STRETCH = 1.4
LEFT_INCHES, RIGHT_INCHES, TOP_INCHES, BOTTOM_INCHES = 0.68, 0.15, 0.28, 0.82  # the legend is in the bottom margin
GAP_INCHES, ROW_GAP_INCHES = 0.22, 0.68
INCHES_PER_LETTER, TICK_INCHES, LABEL_INCHES_MAX = 0.085, 0.25, 3.0
LEGEND_COLUMNS = 7
LEGEND_MARK_INCHES = 0.55  # beside the text of an entry
SHORT_AXIS_DECADES = 1.5
BAR_STRENGTH = 0.55
MINOR_TICK_POINTS = 5.0  # half of it is outside the axes and cut off
PLAIN_EXPONENT = 2  # 0.01 … 100 need no power


def cell_title(cell: CellLike) -> str:
    """Band and exposure of a cell, as a title."""
    return literal(f"{cell.instrument} · {cell.band} · {cell.exposure_ks:g} ks")


def panel_figure(
    titles: Sequence[str],
    draw: Callable[[int, Any], None],
    x_label: str,
    y_label: str,
    n_columns: int = 2,
    share_x: bool = False,
    share_y: bool = False,
    row_labels: Sequence[str] = (),
) -> bytes:
    """Call draw(i, axes) for each title and return the PNG, its legend collected below the panels.

    row_labels: texts on the y axis, for which every panel leaves room. The layout is fixed in inches: letting
    matplotlib fit it takes longer than the drawing.
    """
    import matplotlib as mpl

    n_columns = min(n_columns, len(titles))
    n_rows = -(-len(titles) // n_columns)
    room = min(INCHES_PER_LETTER * max(map(len, row_labels)) + TICK_INCHES, LABEL_INCHES_MAX) if row_labels else 0.0
    left = max(LEFT_INCHES, room)
    with mpl.rc_context(SETTINGS):
        figure, grid = panel_grid(
            (n_rows, n_columns), PANEL_INCHES, (left, GAP_INCHES if share_y else left), share_x=share_x, share_y=share_y
        )
        handles: dict[str, Any] = {}
        for place, axes in enumerate(grid.flat):
            if place >= len(titles):
                axes.set_axis_off()
                continue
            draw(place, axes)
            axes.set_title(titles[place], loc="left", y=1.0)  # given, so that it need not be looked for
            if place >= len(titles) - n_columns:
                axes.set_xlabel(x_label)
                axes.tick_params(labelbottom=True)
            if place % n_columns == 0:
                axes.set_ylabel(y_label)
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles[label] = handle  # the last one: pale parts of a curve come first
        if handles:
            widest = max(map(len, handles)) * INCHES_PER_LETTER + LEGEND_MARK_INCHES
            columns = max(1, min(LEGEND_COLUMNS, int(figure.get_figwidth() / widest)))
            columns = -(-len(handles) // -(-len(handles) // columns))  # lines of equal length
            figure.legend(handles.values(), handles.keys(), loc="lower center", ncols=columns)
        return png_of(figure)


def panel_grid(
    shape: tuple[int, int],
    panel_inches: tuple[float, float],
    left_inches: tuple[float, float],
    right_inches: float = RIGHT_INCHES,
    share_x: bool = False,
    share_y: bool = False,
) -> tuple[Any, Any]:
    """A figure and its grid of axes of this size; left_inches: left of the first column, and between columns."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    (n_rows, n_columns), (wide, high), (left, between) = shape, panel_inches, left_inches
    wide = wide if n_columns > 1 else wide * LONE_PANEL_STRETCH
    width = left + n_columns * wide + (n_columns - 1) * between + right_inches
    height = TOP_INCHES + n_rows * high + (n_rows - 1) * ROW_GAP_INCHES + BOTTOM_INCHES
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    grid = figure.subplots(n_rows, n_columns, squeeze=False, sharex=share_x, sharey=share_y)
    figure.subplots_adjust(
        left / width, BOTTOM_INCHES / height, 1.0 - right_inches / width, 1.0 - TOP_INCHES / height,
        wspace=between / wide, hspace=ROW_GAP_INCHES / high,
    )  # fmt: skip
    return figure, grid


def errors(rows: DataFrame, value: str, lower: str, upper: str) -> Any:
    """(2, n) lengths of error bars; none where the ends are not known."""
    import numpy as np

    below = (rows[value] - rows[lower]).to_numpy(float)
    above = (rows[upper] - rows[value]).to_numpy(float)
    return np.nan_to_num(np.clip(np.vstack((below, above)), 0.0, None), nan=0.0, posinf=0.0)


def log_x(axes: Any, as_powers: bool) -> None:
    """Logarithmic x with few, readable labels: 1, 2, 5 of a decade where the axis is short.

    as_powers: labels such as 2×10⁻¹⁵ (fluxes), else plain numbers (counts).
    """
    axes.set_xscale("log")
    _label_decades(axes, axes.xaxis, axes.get_xlim(), as_powers)


def log_y(axes: Any) -> None:
    """Logarithmic y, labelled like x."""
    axes.set_yscale("log")
    _label_decades(axes, axes.yaxis, axes.get_ylim(), as_powers=True)


def _label_decades(axes: Any, axis: Any, limits: tuple[float, float], as_powers: bool) -> None:
    import numpy as np
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    low, high = limits
    decades = np.log10(high / low)
    steps = (
        (1.0, 2.0, 5.0) if decades < SHORT_AXIS_DECADES else (1.0, 3.0) if decades < 2 * SHORT_AXIS_DECADES else (1.0,)
    )
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FuncFormatter(lambda x, _: _power(x) if as_powers else f"{x:g}"))
    # Minor ticks are one line of markers: as ticks they would take half of the drawing time.
    axis.set_minor_locator(NullLocator())
    whole = np.arange(np.floor(np.log10(low)) - 1, np.ceil(np.log10(high)) + 1)
    marks = np.outer(10.0**whole, np.arange(1, 10)).ravel()
    is_x = axis is axes.xaxis
    x, y = (marks, 0.0 * marks) if is_x else (0.0 * marks, marks)
    transform = axes.get_xaxis_transform() if is_x else axes.get_yaxis_transform()
    axes.add_artist(
        Line2D(
            x, y, marker="|" if is_x else "_", ls="none", color="#555555", ms=MINOR_TICK_POINTS, mew=0.5,
            transform=transform,
        )
    )  # fmt: skip


def _power(value: float) -> str:
    """2×10⁻¹⁵; powers near 1 as plain numbers."""
    mantissa, exponent = f"{value:.0e}".split("e")
    if abs(int(exponent)) <= PLAIN_EXPONENT:
        return f"{value:g}"
    factor = "" if mantissa == "1" else f"{mantissa}×"
    return factor + "10" + str(int(exponent)).translate(SUPERSCRIPT)


def soft_bars(container: Any, strength: float = 1.0) -> None:
    """Let the intervals stand back behind the curve."""
    for bars in container[2]:
        bars.set_alpha(BAR_STRENGTH * strength)


def fields_phrase(tables: DataFrame) -> str:
    """ "10 fields" or "6 to 10 fields" of the rows of a table."""
    least, most = int(tables["n_fields"].min()), int(tables["n_fields"].max())
    return f"{most} field{'s' if most != 1 else ''}" if least == most else f"{least} to {most} fields"
