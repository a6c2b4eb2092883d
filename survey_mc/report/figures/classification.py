"""Contamination against completeness of the extended class, when the cut of each statistic is moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from survey_mc.report.classified import BRIGHT_CENTRAL
from survey_mc.report.figures.panels import cell_title, errors, fields_phrase, panel_figure, soft_bars
from survey_mc.report.figures.style import Figure, Look, literal
from survey_mc.report.source import CellLike

if TYPE_CHECKING:
    from pandas import DataFrame

LINES: tuple[Any, ...] = ("-", (0, (4, 2)))  # first and second statistic of a method; further ones are in the table
ENOUGH_CALLED = 10  # fewer called extended say nothing about their contamination
BAND_STRENGTH = 0.12
HIGH = 1.02


def classification_figure(
    curves: DataFrame, cuts: DataFrame, cells: Sequence[CellLike], look: dict[str, Look], rule: str
) -> Figure | None:
    """One panel a cell with extended sources; None without any. curves, cuts: the two tables of classification."""
    rows = _chosen(curves, rule)
    rows = rows[rows["n_extended_called"] + rows["n_other_called"] >= ENOUGH_CALLED]
    shown = [cell for cell in cells if (rows["cell"] == cell.label).any()]
    if not shown:
        return None
    points = _chosen(cuts, rule)
    statistics = {label: _statistics(points[points["method"] == label]) for label in look}

    def draw(place: int, axes: Any) -> None:
        here, cut = (t[t["cell"] == shown[place].label] for t in (rows, points))
        for label, style in look.items():
            for nth, name in enumerate(statistics[label]):
                curve = here[(here["method"] == label) & (here["statistic"] == name)]
                if not len(curve):
                    continue
                axes.plot(curve["completeness"], curve["contamination"], color=style.colour, ls=LINES[nth],
                          label=literal(label) if nth == 0 else None)  # fmt: skip
                if nth == 0:
                    ends = (curve["contamination_lower"], curve["contamination_upper"])
                    axes.fill_between(curve["completeness"], *ends, color=style.colour, alpha=BAND_STRENGTH, lw=0)
                at = cut[(cut["method"] == label) & (cut["statistic"] == name)]
                bars = axes.errorbar(
                    *(at["completeness"], at["contamination"]),
                    errors(at, "contamination", "contamination_lower", "contamination_upper"),
                    errors(at, "completeness", "completeness_lower", "completeness_upper"),
                    color=style.colour, marker=style.marker, ls="none", elinewidth=0.8, ms=5.0,
                    mfc=style.colour if nth == 0 else "white",
                )  # fmt: skip
                soft_bars(bars)
        axes.set(xlim=(-0.02, HIGH), ylim=(-0.02, HIGH))

    png = panel_figure(
        [cell_title(c) for c in shown], draw, "completeness: extended called extended", "contamination", share_y=True
    )
    listing = "; ".join(f"{label} {', '.join(names)}" for label, names in statistics.items() if names)
    caption = (
        f"Of the detections called extended, the fraction that is not, against the fraction of the extended detections "
        f"that is called so, when the cut moves ({rule} rule, {BRIGHT_CENTRAL}, {fields_phrase(rows)} per panel). "
        f"Symbols: the usual cuts, with 68 % Jeffreys intervals as in the bands. First statistic solid, second dashed "
        f"with an open symbol: {listing}. Long straight pieces join cuts between which the statistic has no "
        f"value. Contamination depends on the mixture of the sky. Cuts that call fewer than "
        f"{ENOUGH_CALLED} detections extended are left out."
    )
    return Figure("classification", "Point or extended: contamination against completeness", png, caption,
                  ("classification", "classification_curve"))  # fmt: skip


def _chosen(table: DataFrame, rule: str) -> DataFrame:
    return table[(table["rule"] == rule) & (table["selection"] == BRIGHT_CENTRAL)]


def _statistics(rows: DataFrame) -> list[str]:
    """The first two statistics of a method that have a curve."""
    return list(dict.fromkeys(rows.loc[rows["auc"].notna(), "statistic"]))[: len(LINES)]
