"""Inferred over input counts of the members of designed pairs (Tests 1 and 2).

Idea     a row of panels for each procedure, a column for each separation; ratio against the counts of the member that
         varies. The first image is drawn large, as the paper's single image; behind it median and 68 % of all images.
Source   paper Figs. "test1:results" and "test2:res".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from survey_mc.paper.figures.rows import FIRST, Procedure, matches, mean_text, procedures, truth
from survey_mc.paper.figures.sheet import GUIDE, handle, legend_below, note, sheet
from survey_mc.paper.results import StudyResults
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

Role = Literal["fixed", "varying"]
RATIO_MAX = 2.0  # of the axis; larger ratios are written beside an arrow, as in the paper
Y_LIMITS = (-0.80, 2.42)  # room for the numbers below, for the arrows above
SIDE = {"fixed": 1.0 / 1.09, "varying": 1.09}  # members of a pair stand beside each other
HALF_TICK = 1.04  # half of the width of a median
PANEL_INCHES = (2.35, 1.36)
QUANTILES = (0.16, 0.5, 0.84)


@dataclass(frozen=True, slots=True)
class Member:
    """How one member of the pairs is drawn. role: which one it is; noun: what it is called in the legend."""

    role: Role
    marker: str
    sign: str
    noun: str


def pair_members(sources: DataFrame) -> DataFrame:
    """The true sources of pairs with columns separation_arcsec, pair_counts (of the varying member) and role."""
    first = sources.groupby(["realisation", "group_id"])["source_id"].transform("min")
    role = np.where(sources["source_id"] == first, "fixed", "varying")
    members = sources[["realisation", "source_id", "group_id"]].assign(
        separation_arcsec=sources["group_sep_arcsec"], role=role, counts_in=sources["counts_onaxis"]
    )
    varying = members.loc[members["role"] == "varying", ["realisation", "group_id", "counts_in"]]
    varying = varying.rename(columns={"counts_in": "pair_counts"})
    return members.merge(varying, on=["realisation", "group_id"], validate="many_to_one")


def pair_ratios(members: DataFrame, found: DataFrame) -> DataFrame:
    """All members with `ratio` = counts found / input counts, NaN where they were missed."""
    rows = found.loc[found["status"] == "matched", ["realisation", "source_id", "counts"]]
    rows = rows.astype({"realisation": "int32", "source_id": "int32"})
    joined = members.merge(rows, how="left", on=["realisation", "source_id"], validate="one_to_one")
    return joined.assign(ratio=joined["counts"] / joined["counts_in"])


def ratio_figure(results: StudyResults, campaign: str, members: tuple[Member, Member]) -> Figure:
    """The panels of all procedures of a campaign."""
    sources = pair_members(truth(results, campaign))
    separations = sorted(sources["separation_arcsec"].unique())
    shown = procedures(results, campaign)
    figure, grid = sheet(
        (len(shown), len(separations)), PANEL_INCHES, margins=(0.72, 0.3, 0.3, 0.85), gaps=(0.1, 0.1),
        share_x=True, share_y=True,
    )  # fmt: skip
    counts = np.array(sorted(sources["pair_counts"].unique()))
    for chosen, row in zip(shown, grid, strict=True):
        ratios = pair_ratios(sources, matches(results, campaign, chosen.label))
        for separation, axes in zip(separations, row, strict=True):
            _panel(axes, ratios[ratios["separation_arcsec"] == separation], chosen, members)
        row[0].set_ylabel(f"{chosen.label}\nSCTS(out) / SCTS(in)", fontsize=7.5)
    for separation, axes in zip(separations, grid[0], strict=True):
        axes.set_title(f"δr = {separation:g}″", loc="left")
    _dress(grid, counts)
    grid[-1][len(separations) // 2].set_xlabel("input counts of the member that varies")
    legend_below(figure, _handles(members), 4)
    return figure


def _panel(axes: Any, ratios: DataFrame, chosen: Procedure, members: tuple[Member, Member]) -> None:
    axes.axhline(1.0, color=GUIDE, lw=0.8, zorder=1)
    lines = []
    for member in members:
        rows = ratios[ratios["role"] == member.role]
        _all_images(axes, rows, chosen, member)
        image = rows[rows["realisation"] == FIRST]
        _one_image(axes, image, chosen, member)
        found, n_found = int(image["ratio"].notna().sum()), int(rows["ratio"].notna().sum())
        share = f"{100.0 * n_found / len(rows):.0f} %" if len(rows) else "0 %"
        lines.append(
            f"{member.sign} {found}/{len(image)}: {mean_text(image['ratio'])}   all {share}: {mean_text(rows['ratio'])}"
        )
    note(axes, 0.015, 0.17, "\n".join(lines), fontsize=6.0, linespacing=1.15)


def _all_images(axes: Any, rows: DataFrame, chosen: Procedure, member: Member) -> None:
    """Median and 68 % of each number of counts, over all images."""
    known = rows[rows["ratio"].notna()].groupby("pair_counts")["ratio"]
    low, middle, high = (known.quantile(share) for share in QUANTILES)
    x = middle.index.to_numpy(np.float64) * SIDE[member.role]
    axes.vlines(x, low, high, color=chosen.look.colour, alpha=0.35, lw=4.0, zorder=2)
    axes.hlines(middle, x / HALF_TICK, x * HALF_TICK, color=chosen.look.colour, lw=1.2, alpha=0.8, zorder=3)


def _one_image(axes: Any, image: DataFrame, chosen: Procedure, member: Member) -> None:
    """The ratios of one image; beyond the axis an arrow and the number."""
    x = image["pair_counts"].to_numpy(np.float64) * SIDE[member.role]
    ratio = image["ratio"].to_numpy(np.float64)
    face = "white" if member.sign in "□○" else chosen.look.colour
    style = {"marker": member.marker, "ls": "none", "ms": 4.6, "mfc": face, "mec": "#222222", "mew": 0.8}
    inside = ratio <= RATIO_MAX
    axes.plot(x[inside], ratio[inside], zorder=5, **style)
    for x_far, far in zip(x[ratio > RATIO_MAX], ratio[ratio > RATIO_MAX], strict=True):
        axes.plot(x_far, RATIO_MAX, zorder=5, **style)
        axes.annotate(
            "", (x_far, RATIO_MAX + 0.36), (x_far, RATIO_MAX + 0.05), arrowprops={"arrowstyle": "->", "lw": 0.7}
        )
        axes.annotate(f"{far:.1f}", (x_far, RATIO_MAX + 0.12), (3, 0), textcoords="offset points", fontsize=6.0)


def _dress(grid: Any, counts: FloatArray) -> None:
    """Axes that all panels share: the counts that occur, as plain numbers."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axes = grid[0][0]
    axes.set(xscale="log", xlim=(counts.min() / 1.3, counts.max() * 1.3), ylim=Y_LIMITS)
    axes.set_yticks([0.0, 0.5, 1.0, 1.5, 2.0])
    for panel in grid.flat:
        panel.xaxis.set_major_locator(FixedLocator(counts.tolist()))
        panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.xaxis.set_minor_locator(NullLocator())


def _handles(members: tuple[Member, Member]) -> list[Any]:
    signs = [
        handle(
            f"{m.noun}, first image",
            marker=m.marker, ls="none", ms=4.6, mfc="white" if m.sign in "□○" else GUIDE, mec="#222222", mew=0.8,
        )
        for m in members
    ]  # fmt: skip
    return [
        *signs,
        handle("median and 68 % of all images", color=GUIDE, lw=4.0, alpha=0.4),
    ]
