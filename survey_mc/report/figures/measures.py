"""What methods give for found sources and beyond: false detections, photometry, positions, cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.report.figures.panels import cell_title, errors, fields_phrase, log_x, panel_figure, soft_bars
from survey_mc.report.figures.style import Figure, Look, literal
from survey_mc.report.source import CellLike

if TYPE_CHECKING:
    from pandas import DataFrame

FALSE_PARTS = (("spurious", 1.0, ""), ("blend", 0.55, "////"), ("faint", 0.25, "...."))
COUNTS_MIN_SHOWN = 5  # sources in a bin below which a median with quantiles says little
SHIFT = 0.012


def false_figure(table: DataFrame, cells: Sequence[CellLike], look: dict[str, Look], rule: str) -> Figure | None:
    """One panel a cell, one bar a method, split by kind."""
    rows = table[table["rule"] == rule]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        here = rows[rows["cell"] == shown[place].label].set_index("method")
        labels = [label for label in look if label in here.index]
        for height, label in enumerate(labels):
            row, start = here.loc[label], 0.0
            for status, strength, hatch in FALSE_PARTS:
                width = row[f"n_{status}"] / row["n_fields"]
                axes.barh(height, width, left=start, height=0.68, color=look[label].colour, alpha=strength, hatch=hatch,
                          edgecolor="white", lw=0.5)  # fmt: skip
                start += width
            ends = [[row["false_per_field"] - row["false_per_field_lower"]],
                    [row["false_per_field_upper"] - row["false_per_field"]]]  # fmt: skip
            axes.errorbar(row["false_per_field"], height, xerr=ends, color="#222222", capsize=2.5, lw=1.0)
        axes.set_yticks(range(len(labels)), [literal(label) for label in labels])
        axes.invert_yaxis()
        axes.set_xlim(left=0)
        axes.grid(axis="y", visible=False)

    png = panel_figure([cell_title(c) for c in shown], draw, "false detections per field", "", row_labels=list(look))
    caption = (
        f"Detections without a counterpart in the input list ({rule} rule), per field, from {fields_phrase(rows)} a "
        "panel: spurious (full), blends (striped) and sources below the count limit (dotted). Bars: 68 % Poisson "
        "intervals of the sum. Duplicates have a counterpart and are not among them."
    )
    return Figure("false_detections", "False detections", png, caption, ("false_detections", "status_counts"))


def photometry_figure(
    table: DataFrame, cells: Sequence[CellLike], look: dict[str, Look], rule: str, by: str
) -> Figure | None:
    """Median ratio with 16 and 84 %: by "counts" (over counts_onaxis) or by "flux" (over the true flux)."""
    ratio, selection, x_label, y_label = {
        "counts": ("counts / counts_onaxis", "counts bin", "input counts (rate × exposure)", "counts / input counts"),
        "flux": ("flux / flux_true", "flux bin", "true flux (erg cm⁻² s⁻¹)", "measured / true flux"),
    }[by]
    rows = table[(table["rule"] == rule) & (table["ratio"] == ratio) & (table["selection"] == selection)]
    rows = rows[rows["n"] >= COUNTS_MIN_SHOWN]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        _median_curves(axes, rows[rows["cell"] == shown[place].label], look, "median", "q16", "q84")
        for level, line in ((1.0, "-"), (0.5, (0, (4, 3))), (2.0, (0, (4, 3)))):
            axes.axhline(level, color="#777777", ls=line, lw=0.8, zorder=0)
        log_x(axes, as_powers=by == "flux")
        axes.set(yscale="log", ylim=(0.2, 5.0))
        axes.set_yticks([0.25, 0.5, 1.0, 2.0, 4.0], ["¼", "½", "1", "2", "4"])
        axes.yaxis.minorticks_off()

    png = panel_figure([cell_title(c) for c in shown], draw, x_label, y_label, share_y=True)
    denominator = (
        "input counts are un-vignetted, so a method that does not correct lies below 1 off axis"
        if by == "counts"
        else "fluxes are corrected for vignetting"
    )
    caption = (
        f"Measured over true {by} of matched sources ({rule} rule), {fields_phrase(rows)} per panel: median, and bars "
        f"from 16 to 84 % of the sources (not the error of the median); {denominator}. Dashed: a factor of two. Bins "
        f"with fewer than {COUNTS_MIN_SHOWN} sources are left out."
    )
    return Figure(f"photometry_{by}", f"Photometry against {by}", png, caption, ("photometry",))


def position_figure(table: DataFrame, cells: Sequence[CellLike], look: dict[str, Look], rule: str) -> Figure | None:
    """Radius of 68 % of the separations against input counts."""
    rows = table[(table["rule"] == rule) & (table["selection"] == "counts bin") & (table["n"] >= COUNTS_MIN_SHOWN)]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        here = rows[rows["cell"] == shown[place].label]
        _median_curves(axes, here, look, "one_sigma_arcsec", "one_sigma_lower_arcsec", "one_sigma_upper_arcsec")
        log_x(axes, as_powers=False)
        axes.set_ylim(bottom=0.0)

    png = panel_figure([cell_title(c) for c in shown], draw, "input counts (rate × exposure)", "position error (″)")
    caption = (
        f"Radius that holds 68 % of the matched detections around their sources ({rule} rule), "
        f"{fields_phrase(rows)} per panel, with 68 % intervals. Bins with fewer than {COUNTS_MIN_SHOWN} sources are "
        "left out."
    )
    return Figure("positions", "Position errors", png, caption, ("astrometry",))


def cost_figure(table: DataFrame, cells: Sequence[CellLike], look: dict[str, Look]) -> Figure | None:
    """CPU seconds of detection per field."""
    # A journal may tell of labels that the campaign had before.
    rows = table[(table["stage"] == "detect") & table["cpu_s_per_field"].gt(0) & table["method"].isin(list(look))]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        here = rows[rows["cell"] == shown[place].label].set_index("method")
        labels = [label for label in look if label in here.index]
        seconds = [here.loc[label, "cpu_s_per_field"] for label in labels]
        axes.barh(range(len(labels)), seconds, height=0.68, color=[look[label].colour for label in labels])
        for height, value in enumerate(seconds):
            axes.annotate(f" {value:.2g} s", (value, height), va="center", fontsize=8)
        axes.set_xlim(0.0, max(seconds) * 1.25)
        axes.set_yticks(range(len(labels)), [literal(label) for label in labels])
        axes.invert_yaxis()
        axes.grid(axis="y", visible=False)

    png = panel_figure([cell_title(c) for c in shown], draw, "CPU seconds per field", "", row_labels=list(look))
    fields = int(rows["fields"].max())
    caption = (
        f"Processor time of detection per field, mean of up to {fields} fields as the journal recorded them (no "
        "interval: it depends on the machine and its load, and is not reproducible)."
    )
    return Figure("cost", "Cost", png, caption, ("cpu_seconds",))


def _median_curves(axes: Any, rows: DataFrame, look: dict[str, Look], value: str, lower: str, upper: str) -> None:
    for nth, (label, style) in enumerate(look.items()):
        curve = rows[rows["method"] == label]
        if len(curve):
            middle = np.sqrt(curve["lower_edge"] * curve["upper_edge"])
            bars = axes.errorbar(
                *(middle * 10.0 ** (SHIFT * (nth - (len(look) - 1) / 2)), curve[value]),
                errors(curve, value, lower, upper),
                color=style.colour, marker=style.marker, ls=style.line, elinewidth=0.8, label=literal(label),
            )  # fmt: skip
            soft_bars(bars)
