"""A grid of panels, one for each cell, with one legend for all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.report.figures.style import SETTINGS, literal, png_of
from survey_mc.report.source import CellLike

if TYPE_CHECKING:
    from pandas import DataFrame

PANEL_INCHES = (4.6, 3.3)
LEGEND_COLUMNS = 7
SHORT_AXIS_DECADES = 1.5
BAR_STRENGTH = 0.55


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
) -> bytes:
    """Call draw(i, axes) for each title and return the PNG, its legend collected below the panels."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    n_columns = min(n_columns, len(titles))
    n_rows = -(-len(titles) // n_columns)
    with mpl.rc_context(SETTINGS):
        size = (PANEL_INCHES[0] * max(n_columns, 1.4), PANEL_INCHES[1] * n_rows + 0.5)
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(n_rows, n_columns, squeeze=False, sharex=share_x, sharey=share_y)
        handles: dict[str, Any] = {}
        for place, axes in enumerate(grid.flat):
            if place >= len(titles):
                axes.set_axis_off()
                continue
            draw(place, axes)
            axes.set_title(titles[place], loc="left")
            if place >= len(titles) - n_columns:
                axes.set_xlabel(x_label)
            if place % n_columns == 0:
                axes.set_ylabel(y_label)
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        if handles:
            n_lines = -(-len(handles) // LEGEND_COLUMNS)
            columns = -(-len(handles) // n_lines)
            figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)
        return png_of(figure)


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
    import numpy as np
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    low, high = axes.get_xlim()
    decades = np.log10(high / low)
    steps = (
        (1.0, 2.0, 5.0) if decades < SHORT_AXIS_DECADES else (1.0, 3.0) if decades < 2 * SHORT_AXIS_DECADES else (1.0,)
    )
    axes.xaxis.set_major_locator(LogLocator(subs=steps))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: _power(x) if as_powers else f"{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _power(value: float) -> str:
    """2×10⁻¹⁵ in mathematical type."""
    mantissa, exponent = f"{value:.0e}".split("e")
    factor = "" if mantissa == "1" else rf"{mantissa}\times "
    return rf"${factor}10^{{{int(exponent)}}}$"


def soft_bars(container: Any) -> None:
    """Let the intervals stand back behind the curve."""
    for bars in container[2]:
        bars.set_alpha(BAR_STRENGTH)


def fields_phrase(tables: DataFrame) -> str:
    """ "10 fields" or "6 to 10 fields" of the rows of a table."""
    least, most = int(tables["n_fields"].min()), int(tables["n_fields"].max())
    return f"{most} field{'s' if most != 1 else ''}" if least == most else f"{least} to {most} fields"
