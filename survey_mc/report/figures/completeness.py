"""Completeness against true flux (or counts), with intervals and the 90 % line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.report.figures.panels import cell_title, errors, fields_phrase, log_x, panel_figure, soft_bars
from survey_mc.report.figures.style import Figure, Look, literal
from survey_mc.report.source import CellLike

if TYPE_CHECKING:
    from pandas import DataFrame

AXIS = {"flux_true_cgs": "true flux (erg cm⁻² s⁻¹)", "counts_expected": "expected counts"}
SHORT = {"flux_true_cgs": "flux", "counts_expected": "counts"}
HEADLINE_LEVEL = 0.9
SHIFT = 0.012  # dex, so that intervals of methods do not hide each other
ENOUGH_SOURCES = 5  # bins with fewer stand back and are not joined
FEW_STRENGTH = 0.3


def completeness_figure(
    table: DataFrame, cells: Sequence[CellLike], look: dict[str, Look], rule: str, quantity: str
) -> Figure | None:
    """One panel a cell; None if the table has no rows for the rule and quantity."""
    rows = table[(table["rule"] == rule) & (table["quantity"] == quantity)]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None

    def draw(place: int, axes: Any) -> None:
        here = rows[rows["cell"] == shown[place].label]
        for nth, (label, style) in enumerate(look.items()):
            curve = here[here["method"] == label]
            if not len(curve):
                continue
            shift = 10.0 ** (SHIFT * (nth - (len(look) - 1) / 2))
            is_rich = curve["n_true"] >= ENOUGH_SOURCES
            for part, line, strength in ((curve[~is_rich], "none", FEW_STRENGTH), (curve[is_rich], style.line, 1.0)):
                bars = axes.errorbar(
                    *(part["centre"] * shift, part["completeness"], errors(part, "completeness", "lower", "upper")),
                    color=style.colour, marker=style.marker, ls=line, elinewidth=0.8, alpha=strength,
                    label=literal(label),
                )  # fmt: skip
                soft_bars(bars, strength)
        axes.axhline(HEADLINE_LEVEL, color="#777777", ls=(0, (1, 2)), lw=1.2)
        log_x(axes, as_powers=quantity == "flux_true_cgs")
        axes.set_ylim(-0.03, 1.05)

    png = panel_figure([cell_title(c) for c in shown], draw, AXIS[quantity], "completeness", share_y=True)
    caption = (
        f"Fraction of the true sources that were found ({rule} rule), against {SHORT[quantity]} as drawn, "
        f"from {fields_phrase(rows)} per panel. Bars: 68 % Jeffreys intervals; dotted: 90 %. "
        f"Pale and not joined: bins of fewer than {ENOUGH_SOURCES} sources. Methods are set apart sideways by 3 %."
    )
    return Figure(
        f"completeness_{SHORT[quantity]}_{rule}", f"Completeness against {SHORT[quantity]}", png, caption,
        ("completeness", "completeness_limit"),
    )  # fmt: skip
