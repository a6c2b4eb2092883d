"""Test 5 of the paper: number counts, differential and integral, and photometry.

Idea     detections inside 10′ are counted by their measured flux without any identification, as an observer would.
Source   paper Figs. "test5:diff", "test5:integ", "test5:photo".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import (
    CHOSEN,
    RIVAL,
    Procedure,
    cell,
    detections,
    fields_phrase,
    matches,
    mean_text,
    procedure,
    thinned,
    truth,
)
from survey_mc.paper.figures.sheet import (
    DASHED,
    FLUX_LABEL,
    GUIDE,
    drawing,
    equality_lines,
    handle,
    legend_below,
    note,
    positive,
    sheet,
)
from survey_mc.paper.figures.test5_completeness import BAND_KEV, BINS, FLUX_LIMITS, paper_limit_cgs
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_5
from survey_mc.report.figures.panels import log_x, log_y
from survey_mc.report.figures.style import INPUT_COLOUR
from survey_mc.stats.bins import LogBins
from survey_mc.stats.false_detections import FALSE_STATUSES
from survey_mc.stats.intervals import garwood
from survey_mc.types import FloatArray
from survey_mc.units import rate_from_flux

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from survey_mc.store import CellRecord

BAND, SHALLOW_KS, DEEP_KS = "soft", 10.0, 100.0
FINE_BINS = LogBins("flux_cgs", -17, -11, 50)  # of the true integral counts
LEAST_PER_FIELD = 0.02  # of the axis of differential counts
FALSE_LINE: Any = (0, (3, 2))
SIDE = 1.02  # points of two procedures stand beside each other
INTEGRAL_MARK = {CHOSEN: "o", RIVAL: "s"}


def counts_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """Differential counts, integral counts, photometry."""
    shown = [p for p in (procedure(results, TEST_5, name) for name in (CHOSEN, RIVAL)) if p is not None]
    if not shown:
        return
    fields = fields_phrase(results.n_fields(TEST_5))
    with drawing():
        deep = cell(results, TEST_5, BAND, DEEP_KS)
        yield PaperFigure(
            "test5_differential_counts",
            "Test 5: differential counts",
            f"The paper's Fig. 14. Number per field inside 10′ and bin of 0.2 dex, {BAND_KEV[deep.band]}, "
            f"{deep.exposure_ks:g} ks, mean of {fields} of {TEST_5}. Continuous: true sources by true flux; points: "
            "detections by measured flux, without any identification, with 68 % Poisson errors of the mean; dashed: "
            "detections without a listed input (fluctuations, blends, sources below the count limit).",
            _differential_figure(results, shown, deep),
        )
        cells = [cell(results, TEST_5, BAND, ks) for ks in (SHALLOW_KS, DEEP_KS)]
        yield PaperFigure(
            "test5_integral_counts",
            "Test 5: integral counts",
            f"The paper's Fig. 15. Number inside 10′ (0.087 deg²) above a flux, {BAND_KEV[BAND]}, mean of {fields} of "
            f"{TEST_5}. Histogram: true sources; circles: {shown[0].label}; boxes: "
            f"{shown[-1].label}; both without identification, with 68 % Poisson errors of the mean, set apart sideways "
            "by 2 %. Points of one procedure are correlated, and false detections make up for lost sources. Dashed: "
            "the paper's 90 % limit.",
            _integral_figure(results, shown, cells),
        )
        yield PaperFigure(
            "test5_photometry",
            f"Test 5: photometry of {shown[0].label}",
            f"The paper's Fig. 16. Measured against true flux of identified sources inside 10′, all {fields} of "
            f"{TEST_5} (thinned to 3000 points), {BAND_KEV[BAND]}. Lines: equality and factors of two (dashed); "
            "vertical: the paper's 90 % limit, mean and standard deviation of measured over true flux above it are "
            "given, for fluxes and for counts. The paper compares counts, whose measured ones are vignetted and "
            "whose input ones are not; fluxes are corrected for vignetting.",
            _photometry_figure(results, shown[0], cells),
        )


def per_field(values: FloatArray, n_fields: int) -> FloatArray:
    """Mean number per field in each flux bin."""
    return BINS.count(values)[:-1] / n_fields


def inside_fluxes(rows: DataFrame, region_arcmin: float) -> FloatArray:
    """Fluxes of the true sources or detections inside the region."""
    inside = np.asarray(rows["offaxis_arcmin"], dtype=np.float64) <= region_arcmin
    return np.asarray(rows["flux_cgs"].to_numpy(np.float64)[inside])


def false_fluxes(found: DataFrame) -> FloatArray:
    """Measured fluxes of detections without a listed input."""
    return np.asarray(found.loc[found["status"].isin(FALSE_STATUSES), "flux_cgs"], dtype=np.float64)


def _with_errors(axes: Any, x: FloatArray, numbers: FloatArray, n_fields: int, style: dict[str, Any]) -> None:
    """Numbers over all fields as means per field with Poisson errors; empty ones are left out."""
    seen = numbers > 0
    lower, upper = garwood(numbers[seen])
    mean = numbers[seen] / n_fields
    axes.errorbar(
        x[seen], mean, np.vstack((mean - lower / n_fields, upper / n_fields - mean)), ls="none", elinewidth=1.0, **style
    )


def _differential_figure(results: StudyResults, shown: list[Procedure], record: CellRecord) -> Figure:
    figure, grid = sheet((1, len(shown)), (3.9, 3.1), share_y=True, margins=(0.7, 0.15, 0.3, 0.95))
    inputs = inside_fluxes(truth(results, TEST_5, record.label), record.region_arcmin)
    middle = np.sqrt(BINS.edges[:-1] * BINS.edges[1:])
    n_fields = record.realisations
    for chosen, axes in zip(shown, grid[0], strict=True):
        found = inside_fluxes(detections(results, TEST_5, chosen.label, record.label), record.region_arcmin)
        false = false_fluxes(matches(results, TEST_5, chosen.label, record.label))
        axes.stairs(positive(per_field(inputs, n_fields)), BINS.edges, color=INPUT_COLOUR, lw=1.3)
        axes.stairs(positive(per_field(false, n_fields)), BINS.edges, color=chosen.look.colour, ls=FALSE_LINE, lw=1.4)
        style = {"color": chosen.look.colour, "marker": "o", "ms": 4.5}
        _with_errors(axes, middle, BINS.count(found)[:-1].astype(np.float64), n_fields, style)
        axes.set_title(chosen.label, loc="left")
        _flux_axis(axes, record)
    grid[0][0].set_ylabel("number per field and bin")
    top = max(float(per_field(inputs, n_fields).max()), 1.0)
    grid[0][0].set(yscale="log", ylim=(LEAST_PER_FIELD, 2.5 * top))
    for axes in grid[0]:
        log_y(axes)
    legend_below(figure, [
        handle("true sources", color=INPUT_COLOUR, lw=1.3),
        handle("detections, not identified", color=GUIDE, marker="o", ls="none", ms=4.5),
        handle("false detections", color=GUIDE, ls=FALSE_LINE, lw=1.4),
    ])  # fmt: skip
    return figure


def _integral_figure(results: StudyResults, shown: list[Procedure], cells: list[CellRecord]) -> Figure:
    figure, grid = sheet((1, len(cells)), (3.9, 3.1), share_y=True, margins=(0.7, 0.15, 0.3, 0.95))
    tops = [1.0]
    for record, axes in zip(cells, grid[0], strict=True):
        n_fields = record.realisations
        inputs = above(inside_fluxes(truth(results, TEST_5, record.label), record.region_arcmin), FINE_BINS) / n_fields
        axes.step(FINE_BINS.edges[:-1], positive(inputs), where="post", color=INPUT_COLOUR, lw=1.3)
        for nth, chosen in enumerate(shown):
            found = inside_fluxes(detections(results, TEST_5, chosen.label, record.label), record.region_arcmin)
            face = chosen.look.colour if INTEGRAL_MARK[chosen.name] == "o" else "white"
            style = {"color": chosen.look.colour, "marker": INTEGRAL_MARK[chosen.name], "ms": 5.0, "mfc": face}
            _with_errors(axes, BINS.edges[:-1] * SIDE ** (2 * nth - 1), above(found, BINS), n_fields, style)
        axes.set_title(f"{BAND_KEV[record.band]}, {record.exposure_ks:g} ks", loc="left")
        _flux_axis(axes, record)
        tops.append(float(inputs.max()))
    grid[0][0].set_ylabel("N(> flux) inside 10′, per field")
    grid[0][0].set(yscale="log", ylim=(0.3, 1.6 * max(tops)))
    for axes in grid[0]:
        log_y(axes)
    entries = [handle("true sources", color=INPUT_COLOUR, lw=1.3)]
    for chosen in shown:
        mark = INTEGRAL_MARK[chosen.name]
        face = chosen.look.colour if mark == "o" else "white"
        entries.append(handle(chosen.label, color=chosen.look.colour, marker=mark, ls="none", mfc=face, ms=5.0))
    legend_below(figure, [*entries, handle("the paper's 90 % limit", color=GUIDE, ls=DASHED, lw=1.0)])
    return figure


def above(fluxes_cgs: FloatArray, bins: LogBins) -> FloatArray:
    """Number at and above the lower edge of each flux bin, the overflow included."""
    return np.cumsum(bins.count(fluxes_cgs)[::-1])[::-1][:-1].astype(np.float64)


def _flux_axis(axes: Any, record: CellRecord) -> None:
    axes.set(xscale="log", xlim=FLUX_LIMITS[record.band])
    log_x(axes, as_powers=True)
    axes.set_xlabel(FLUX_LABEL + ", true or measured")
    published = paper_limit_cgs(record)
    if published:
        axes.axvline(published, color=GUIDE, ls=DASHED, lw=1.0, zorder=1)


def photometry_text(found: DataFrame, limit_cgs: float) -> str:
    """Mean (st.dev.) of measured over true flux, and of counts over input counts, of sources above a flux."""
    bright = found[found["flux_true_cgs"] >= limit_cgs]
    flux = mean_text(bright["flux_cgs"] / bright["flux_true_cgs"])
    counts = mean_text(bright["counts"] / bright["counts_onaxis"])
    return f"above the limit\nflux: {flux}\ncounts: {counts}"


def _photometry_figure(results: StudyResults, chosen: Procedure, cells: list[CellRecord]) -> Figure:
    figure, grid = sheet((1, len(cells)), (3.5, 3.5), share_y=True, margins=(0.75, 0.15, 0.62, 0.55))
    low, high = FLUX_LIMITS[BAND]
    for record, axes in zip(cells, grid[0], strict=True):
        rows = matches(results, TEST_5, chosen.label, record.label)
        found = rows[rows["status"] == "matched"]
        cloud = thinned(found)
        axes.scatter(
            cloud["flux_true_cgs"], cloud["flux_cgs"], s=3.5, c=chosen.look.colour, alpha=0.45, linewidths=0,
            rasterized=True, zorder=2,
        )  # fmt: skip
        equality_lines(axes, low, high)
        axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high))
        log_x(axes, as_powers=True)
        log_y(axes)
        published = paper_limit_cgs(record)
        if published:
            axes.axvline(published, color=GUIDE, ls=DASHED, lw=1.2, zorder=3)
            note(axes, 0.97, 0.04, photometry_text(found, published), ha="right", va="bottom", fontsize=8.0)
        axes.set_title(f"{BAND_KEV[record.band]}, {record.exposure_ks:g} ks", loc="left", y=1.09)
        _counts_above(axes, record)
        axes.set_xlabel(f"true {FLUX_LABEL}")
    grid[0][0].set_ylabel(f"measured {FLUX_LABEL}")
    return figure


def _counts_above(axes: Any, record: CellRecord) -> None:
    """The input counts that belong to the true flux, on an axis above."""
    from matplotlib.ticker import FuncFormatter, NullLocator

    counts_per_cgs = float(rate_from_flux(1.0, record.flux_per_rate_cgs)) * record.exposure_ks * 1000.0
    top = axes.secondary_xaxis("top", functions=(lambda f: f * counts_per_cgs, lambda n: n / counts_per_cgs))
    top.xaxis.set_major_formatter(FuncFormatter(lambda n, _: f"{n:g}"))
    top.xaxis.set_minor_locator(NullLocator())
    top.set_xlabel("input counts", fontsize=7.5, labelpad=2.0)
    top.tick_params(labelsize=7.0)
