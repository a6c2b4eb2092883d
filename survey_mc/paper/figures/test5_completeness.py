"""Test 5 of the paper: the deep image, and how many of the inputs are found at each flux.

Idea     found over input of a field with its confusion, beside the same for isolated sources on a grid: the difference
         is what is lost to confusion.
Source   paper Figs. "test5:fig2" and "test5:det", Tab. "test5".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.paper.claims import published_number
from survey_mc.paper.figures.images import first_field, label_arcmin, region_circle, show_image
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import CHOSEN, Procedure, cell, fields_phrase, matches, procedure, procedures
from survey_mc.paper.figures.sheet import DOTTED, FLUX_LABEL, GUIDE, drawing, handle, legend_below, note, sheet
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import GRID, TEST_5
from survey_mc.report.figures.panels import log_x
from survey_mc.report.numbers import power
from survey_mc.rng import stream
from survey_mc.stats import CompletenessCounts
from survey_mc.stats.bins import FLUX_BINS, LogBins
from survey_mc.telescope import INSTRUMENTS
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from survey_mc.store import CellRecord

BINS = LogBins("flux_true_cgs", -17, -11, 5)
LEVEL = 0.9
BAND_KEV = {"soft": "0.5-2 keV", "hard": "2-10 keV"}
FLUX_LIMITS = {"soft": (1.3e-16, 1.1e-13), "hard": (6e-16, 1.6e-13)}
CROSSES_MAX = 20  # realisations drawn one by one
ENOUGH = 5  # sources in a bin below which a mean over all fields is not drawn
DEEP_KS = 100.0
HALF_WIDTH_ARCMIN = 17.0


def paper_limit_cgs(record: CellRecord) -> float | None:
    """The published 90 % limit of MR/1+SE in a band and exposure; None where the paper has none."""
    return published_number(f"test5.limit90.{record.band}.{record.exposure_ks:g}ks")


@dataclass(frozen=True, slots=True)
class FoundFraction:
    """Matched over input sources in flux bins; n_true, n_found: (realisations, bins)."""

    n_true: FloatArray
    n_found: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Of all fields together, NaN where there are too few sources."""
        true = self.n_true.sum(axis=0)
        found = self.n_found.sum(axis=0)
        return np.asarray(np.divide(found, true, out=np.full(true.shape, np.nan), where=true >= ENOUGH))

    @property
    def single(self) -> FloatArray:
        """Of each field, NaN where it has no source."""
        empty = np.full(self.n_true.shape, np.nan)
        return np.asarray(np.divide(self.n_found, self.n_true, out=empty, where=self.n_true > 0))


def completeness_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """The deep image, the detection rate of the chosen procedure, and of all."""
    with drawing():
        yield PaperFigure(
            "test5_image",
            "Test 5: a deep field",
            f"The paper's Fig. 12. Photons of the first field of {TEST_5}, 0.5-2 keV, in its longest exposure; dashed: "
            "the inner 10′ that are analysed; dotted: the field of view. Square-root grey scale. Sources fainter than "
            "1e-16 erg cm⁻² s⁻¹ are part of the background.",
            _deep_image(results),
        )
        cells = results.run(TEST_5).data.cells
        words = (
            f"Mean of {fields_phrase(results.n_fields(TEST_5))} of {TEST_5}, in bins of 0.2 dex, those with fewer than "
            f"{ENOUGH} inputs left out. Inputs: sources inside 10′ above {_limits_phrase(cells)} input counts, so that "
            "the faintest bins hold few."
        )
        chosen = procedure(results, TEST_5, CHOSEN)
        if chosen is not None:
            yield PaperFigure(
                "test5_detection_rate",
                f"Test 5: detection rate of {chosen.label}",
                f"The paper's Fig. 13. Identified over input sources against true flux. Crosses: single fields (the "
                f"first {CROSSES_MAX}); heavy histogram: mean; curve: isolated sources on a grid ({GRID}), without "
                f"confusion; dotted: 90 %; triangle: the paper's 90 % limit. {words} Numbers: 90 % limits by isotonic "
                "regression and the paper's.",
                _chosen_figure(results, chosen),
            )
        yield PaperFigure(
            "test5_detection_rate_all",
            "Test 5: detection rate of all procedures",
            f"Beyond the paper: as the figure before, the means of all procedures (lines) and their rates for isolated "
            f"sources ({GRID}; pale, dashed). Triangle: the paper's 90 % limit for MR/1+SE. {words}",
            _all_figure(results, procedures(results, TEST_5)),
        )


def found_fraction(found: DataFrame, bins: LogBins, n_fields: int) -> FoundFraction:
    """Sources in scope and matched ones by realisation and flux bin."""
    rows = found[found["status"].isin(("matched", "missed"))]
    place = bins.index(rows["flux_true_cgs"].to_numpy(np.float64))
    inside = (place >= 0) & (place < bins.size)
    realisation = rows["realisation"].to_numpy(np.int64)[inside]
    is_found = (rows["status"] == "matched").to_numpy(bool)[inside]
    flat = realisation * bins.size + place[inside]
    shape = (n_fields, bins.size)
    n_true = np.bincount(flat, minlength=n_fields * bins.size).reshape(shape)
    n_found = np.bincount(flat[is_found], minlength=n_fields * bins.size).reshape(shape)
    return FoundFraction(n_true.astype(np.float64), n_found.astype(np.float64))


def isolated_curve(results: StudyResults, label: str, cell_label: str) -> tuple[FloatArray, FloatArray]:
    """Flux and found fraction of the sources of the grid; nothing if it was not run."""
    if not results.has(GRID) or cell_label not in results.run(GRID).cells or label not in results.run(GRID).methods:
        return np.empty(0), np.empty(0)
    rows = matches(results, GRID, label, cell_label)
    rows = rows[rows["status"].isin(("matched", "missed"))]
    exponent = np.round(np.log10(rows["flux_true_cgs"].to_numpy(np.float64)), 4)
    values, place = np.unique(exponent, return_inverse=True)
    n_true = np.bincount(place, minlength=values.size)
    n_found = np.bincount(place, weights=(rows["status"] == "matched").to_numpy(np.float64), minlength=values.size)
    enough = n_true >= ENOUGH
    return 10.0 ** values[enough], n_found[enough] / n_true[enough]


def limit_cgs(results: StudyResults, label: str, record: CellRecord) -> float:
    """Flux of 90 % completeness, NaN where it is not reached."""
    counts = CompletenessCounts(FLUX_BINS, record.realisations)
    counts.add(matches(results, TEST_5, label, record.label))
    limits = counts.limits(stream(f"{record.label}/flux_true_cgs", "resampled fields"))
    return float(next(limit.value for limit in limits if limit.level == LEVEL))


def limit_text(results: StudyResults, chosen: Procedure, record: CellRecord) -> str:
    """The 90 % limit of a procedure in a cell, and the published one."""
    published = paper_limit_cgs(record)
    ours = f"90 % at {power(limit_cgs(results, chosen.label, record))[0]}"
    # "2 × 10⁻¹⁵", as it is printed: no digits that the paper does not have.
    return f"{ours}\npaper: {power(published)[0].replace('.00', '')}" if published else ours


def cell_panels(results: StudyResults) -> list[CellRecord]:
    """The cells in the order of the panels: a row for each band, exposures side by side."""
    cells = results.run(TEST_5).data.cells
    return sorted(cells, key=lambda c: (c.band != "soft", c.exposure_ks))


def rate_axes(axes: Any, record: CellRecord, *, paper_limit: bool = True) -> None:
    """Axes of a detection rate, with 90 % and the paper's limit."""
    axes.axhline(LEVEL, color=GUIDE, ls=DOTTED, lw=1.3, zorder=1)
    published = paper_limit_cgs(record)
    if published and paper_limit:
        axes.plot(published, LEVEL, marker="v", ms=7.0, mfc="white", mec="#222222", mew=1.2, ls="none", zorder=6)
    axes.set(xscale="log", xlim=FLUX_LIMITS[record.band], ylim=(-0.03, 1.08))
    log_x(axes, as_powers=True)
    axes.set_title(f"{BAND_KEV[record.band]}, {record.exposure_ks:g} ks", loc="left")


def rate_curve(axes: Any, found: FoundFraction, chosen: Procedure, **style: Any) -> None:
    """Mean detection rate at the middle of the bins."""
    middle = np.sqrt(BINS.edges[:-1] * BINS.edges[1:])
    mean = found.mean
    seen = np.isfinite(mean)
    look = {"color": chosen.look.colour, "marker": chosen.look.marker, "lw": 1.5, "ms": 3.5, "label": chosen.label}
    axes.plot(middle[seen], mean[seen], **{**look, **style})


def _chosen_figure(results: StudyResults, chosen: Procedure) -> Figure:
    cells = cell_panels(results)
    figure, grid = _rate_sheet(len(cells))
    middle = np.sqrt(BINS.edges[:-1] * BINS.edges[1:])
    for axes, record in zip(grid.flat, cells, strict=False):
        rate_axes(axes, record)
        found = found_fraction(matches(results, TEST_5, chosen.label, record.label), BINS, record.realisations)
        single = found.single[:CROSSES_MAX]
        x = np.broadcast_to(middle, single.shape)
        axes.plot(x.ravel(), single.ravel(), "x", ms=3.2, mew=0.6, color=GUIDE, rasterized=True, zorder=2)
        axes.stairs(found.mean, BINS.edges, baseline=None, color=chosen.look.colour, lw=2.6, zorder=4)
        axes.plot(*isolated_curve(results, chosen.label, record.label), color="#222222", lw=1.2, zorder=3)
        note(axes, 0.98, 0.05, limit_text(results, chosen, record), ha="right", va="bottom", fontsize=8.0)
    entries = [
        handle("single fields", marker="x", ls="none", color=GUIDE, ms=4.0),
        handle(f"mean, {chosen.label}", color=chosen.look.colour, lw=2.6),
        handle("without confusion (grid)", color="#222222", lw=1.2),
        handle("the paper's 90 % limit", marker="v", ls="none", ms=7.0, mfc="white", mec="#222222"),
    ]
    legend_below(figure, entries)
    return figure


def _all_figure(results: StudyResults, shown: Sequence[Procedure]) -> Figure:
    cells = cell_panels(results)
    figure, grid = _rate_sheet(len(cells))
    for axes, record in zip(grid.flat, cells, strict=False):
        rate_axes(axes, record)
        for chosen in shown:
            found = found_fraction(matches(results, TEST_5, chosen.label, record.label), BINS, record.realisations)
            isolated = isolated_curve(results, chosen.label, record.label)
            axes.plot(*isolated, color=chosen.look.colour, lw=1.2, ls=(0, (3, 1.5)), alpha=0.6, zorder=2)
            rate_curve(axes, found, chosen, zorder=3)
    legend_below(figure, [*procedure_handles(shown), handle("isolated", color=GUIDE, lw=1.2, ls=(0, (3, 1.5)))], 7)
    return figure


def procedure_handles(shown: Sequence[Procedure]) -> list[Any]:
    """A legend entry for each procedure."""
    return [handle(p.label, color=p.look.colour, marker=p.look.marker, lw=1.5, ms=4.0) for p in shown]


def _rate_sheet(n_panels: int) -> tuple[Figure, Any]:
    n_columns = min(2, n_panels)
    figure, grid = sheet(
        (-(-n_panels // n_columns), n_columns), (3.9, 2.45), gaps=(0.2, 0.62), margins=(0.65, 0.15, 0.3, 0.95),
        share_y=True,
    )  # fmt: skip
    for row in grid:
        row[0].set_ylabel("found / input")
    for axes in grid[-1]:
        axes.set_xlabel(f"true {FLUX_LABEL}")
    for axes in grid.flat[n_panels:]:
        axes.set_axis_off()
    return figure, grid


def _limits_phrase(cells: Sequence[CellRecord]) -> str:
    limits = {c.exposure_ks: c.counts_min for c in cells}
    return " and ".join(f"{n:g} ({ks:g} ks)" for ks, n in sorted(limits.items()))


def _deep_image(results: StudyResults) -> Figure:
    record = cell(results, TEST_5, "soft", max(c.exposure_ks for c in results.run(TEST_5).data.cells))
    drawn = first_field(results, TEST_5, record.band, record.exposure_ks)
    figure, grid = sheet((1, 1), (5.0, 5.0), margins=(0.62, 0.12, 0.3, 0.5))
    axes = grid[0][0]
    show_image(axes, drawn.photons, drawn.grid)
    region_circle(axes, record.region_arcmin, lw=1.6)
    settings = drawn.campaign.instrument
    view_arcmin = settings.field_of_view_arcmin or INSTRUMENTS[settings.name].field_of_view_arcmin
    region_circle(axes, view_arcmin, ls=DOTTED, lw=1.6)
    axes.set(xlim=(-HALF_WIDTH_ARCMIN, HALF_WIDTH_ARCMIN), ylim=(-HALF_WIDTH_ARCMIN, HALF_WIDTH_ARCMIN), aspect="equal")
    axes.set_title(f"{BAND_KEV[record.band]}, {record.exposure_ks:g} ks", loc="left")
    label_arcmin(grid)
    return figure
