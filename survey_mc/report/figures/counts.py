"""Number counts: differential by method, and integral with the input relation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.report.figures.panels import cell_title, errors, fields_phrase, log_x, log_y, panel_figure, soft_bars
from survey_mc.report.figures.style import INPUT_COLOUR, Figure, Look, literal
from survey_mc.report.source import CellLike
from survey_mc.stats.bins import FLUX_BINS

if TYPE_CHECKING:
    from pandas import DataFrame

MEASURED_FLUX = "flux, true or measured (erg cm⁻² s⁻¹)"
DECADES_BELOW_PEAK = 4.2
SHIFT = 0.008


def differential_figure(table: DataFrame, cell: CellLike, look: dict[str, Look], rule: str) -> Figure | None:
    """One panel a method: input, detections and false detections per flux bin."""
    rows = table[(table["rule"] == rule) & (table["cell"] == cell.label)]
    shown = [label for label in look if (rows["method"] == label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        here = rows[rows["method"] == shown[place]]
        style = look[shown[place]]
        first, last = np.searchsorted(FLUX_BINS.edges, [here["flux_min_cgs"].min(), here["flux_max_cgs"].max()])
        edges = FLUX_BINS.edges[first : last + 1]  # bins without anything have no row, but a place
        everywhere = here.set_index("flux_min_cgs").reindex(edges[:-1])
        middle = np.sqrt(here["flux_min_cgs"] * here["flux_max_cgs"])
        axes.stairs(_positive(everywhere["input_per_deg2"]), edges, color=INPUT_COLOUR, lw=1.2, label="input")
        seen = here["n_detected"] > 0
        axes.errorbar(
            *(middle[seen], here["detected_per_deg2"][seen]),
            errors(here[seen], "detected_per_deg2", "detected_per_deg2_lower", "detected_per_deg2_upper"),
            color=style.colour, marker=style.marker, ls="none", elinewidth=1.0, label="detections",
        )  # fmt: skip
        axes.stairs(
            _positive(everywhere["false_per_deg2"]), edges, color=style.colour, ls=(0, (3, 2)), lw=1.2, label="false"
        )
        log_x(axes, as_powers=True)
        _limit_decades(axes, here["input_per_deg2"], here["detected_per_deg2"])

    png = panel_figure(
        [literal(s) for s in shown], draw, MEASURED_FLUX, "number per deg² and bin", 3, share_x=True, share_y=True
    )
    caption = (
        f"Differential counts, {cell.band} band, {cell.exposure_ks:g} ks, {fields_phrase(rows)}. Line: true "
        "sources, in bins of true flux. Points: detections without any cross-identification, in bins of measured "
        f"flux, with 68 % Poisson intervals. Dashed: the false ones among them ({rule} rule). Bins of 0.1 dex."
    )
    name = f"counts_differential_{_slug(cell.label)}_{rule}"
    title = f"Differential counts, {cell.band} band, {cell.exposure_ks:g} ks"
    return Figure(name, title, png, caption, ("counts_differential",))


def integral_figure(table: DataFrame, cells: Sequence[CellLike], look: dict[str, Look], rule: str) -> Figure | None:
    """One panel a cell: the input relation and what each method counts."""
    rows = table[table["rule"] == rule]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        here = rows[rows["cell"] == shown[place].label]
        relation = here.drop_duplicates("flux_min_cgs").sort_values("flux_min_cgs")
        axes.step(relation["flux_min_cgs"], _positive(relation["input_per_deg2"]), where="pre", color=INPUT_COLOUR,
                  lw=1.2, label="input", zorder=1)  # fmt: skip
        for nth, (label, style) in enumerate(look.items()):
            curve = here[here["method"] == label]
            seen = curve[curve["n_detected"] > 0]
            if not len(seen):
                continue
            shift = 10.0 ** (SHIFT * (nth - (len(look) - 1) / 2))
            bars = axes.errorbar(
                *(seen["flux_min_cgs"] * shift, seen["detected_per_deg2"]),
                errors(seen, "detected_per_deg2", "detected_per_deg2_lower", "detected_per_deg2_upper"),
                color=style.colour, marker=style.marker, ls="none", elinewidth=0.8, label=literal(label),
            )  # fmt: skip
            soft_bars(bars)
        log_x(axes, as_powers=True)
        _limit_decades(axes, here["input_per_deg2"], here["detected_per_deg2"])

    png = panel_figure(
        [cell_title(c) for c in shown], draw, "flux S, true or measured (erg cm⁻² s⁻¹)", "N(≥ S) per deg²"
    )
    caption = (
        f"Integral counts by simple counting, {fields_phrase(rows)} per panel. Line: the true sources; points: "
        "detections without cross-identification, with 68 % Poisson intervals. Points of one method are correlated; "
        "false detections make up for lost sources, so agreement alone proves nothing. Methods are set apart sideways."
    )
    return Figure("counts_integral", "Integral counts (log N – log S)", png, caption, ("counts_integral",))


def _positive(values: Any) -> Any:
    """Values for a logarithmic axis: an empty bin has no place on it."""
    values = np.asarray(values, dtype=float)
    return np.where(values > 0, values, np.nan)


def _limit_decades(axes: Any, *values: Any) -> None:
    """Logarithmic y, kept to the decades that carry information."""
    axes.set_yscale("log")
    top = max((float(np.nanmax(_positive(v))) for v in values if np.any(np.asarray(v) > 0)), default=1.0)
    axes.set_ylim(max(top * 10.0**-DECADES_BELOW_PEAK, axes.get_ylim()[0]), top * 2.0)
    log_y(axes)


def _slug(text: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in text)
