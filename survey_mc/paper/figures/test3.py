"""Test 3 of the paper: a random field of point sources."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.paper.figures.images import (
    DEEP_COUNTS_MIN,
    DEEP_FACTOR,
    DrawnField,
    deep_image,
    first_field,
    image_sheet,
    mark_detections,
    region_circle,
    searched_image,
)
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import (
    FIRST,
    Procedure,
    fields_phrase,
    links,
    matches,
    mean_text,
    procedures,
    thinned,
)
from survey_mc.paper.figures.sheet import (
    DASHED,
    DOTTED,
    GUIDE,
    INPUT_COUNTS_LABEL,
    PALE,
    drawing,
    equality_lines,
    handle,
    legend_below,
    note,
    sheet,
)
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_3
from survey_mc.report.figures.panels import log_x, log_y
from survey_mc.report.figures.style import INPUT_COLOUR
from survey_mc.stats.bins import LogBins
from survey_mc.stats.false_detections import FALSE_STATUSES
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

HALF_WIDTH_ARCMIN = 15.5
BRIGHT_COUNTS = 50.0  # paper Sect. 6.3: mean and spread are given on both sides of it
FAR_ARCSEC = 4.0  # paper Fig. "test3:flux": further off suggests a blend
CLOUD_MAX = 800  # points of the other fields
COUNTS_LIMITS = (8.0, 2800.0)
BLOCK_HEIGHTS, SPACE_HEIGHT = (2.5, 0.95), 0.35  # scatter and histogram, and between procedures (inches)
COUNTS_BINS = LogBins("counts", 0, 4, 5)


@dataclass(frozen=True, slots=True)
class Recovery:
    """Matched sources of one procedure and what it missed or made up.

    matched has columns realisation, counts_in, counts_expected (vignetted), counts_out, sep_arcsec, n_inputs (listed
    inputs inside the search radius). inputs, missed: input counts; false: measured counts of detections without a
    listed input; all fields.
    """

    matched: DataFrame
    inputs: FloatArray
    missed: FloatArray
    false: FloatArray


def test3_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """Images and flux recovery."""
    with drawing():
        drawn = first_field(results, TEST_3)
        yield PaperFigure(
            "test3_images",
            "Test 3: a field of point sources, four images",
            f"The paper's Fig. 8. The first field of {TEST_3}, {drawn.cell.exposure_ks:g} ks, 0.5-2 keV: photons; the "
            f"same sources in {DEEP_FACTOR:g} times the exposure without background, only those above "
            f"{DEEP_COUNTS_MIN:g} input counts; MR/1 filtered; WAVDETECT's smoothed image with its detections as "
            "circles. Square-root grey scale; large circle: the inner 10′ that are analysed.",
            field_images(results, TEST_3, drawn),
        )
        n_fields = results.n_fields(TEST_3)
        record = results.run(TEST_3).data.cells[0]
        yield PaperFigure(
            "test3_flux_recovery",
            "Test 3: recovery of the input counts",
            "The paper's Fig. 9, for all six procedures. Above: detected against input counts of identified sources "
            "inside 10′; large circles: the first field, black if detection and source are more than "
            f"{FAR_ARCSEC:g}″ apart, grey if more than one listed input lies within {record.radius_arcsec:g}″, in "
            f"colour otherwise; small dots: the other fields, thinned to {CLOUD_MAX}. Lines: equality, factors of "
            f"two (dashed), {BRIGHT_COUNTS:g} input counts (dotted). Numbers: mean and standard deviation of output "
            "over input counts on both sides of it, first field | all fields; (v): over vignetted input counts. "
            f"Below, per field, mean of {fields_phrase(n_fields)} of {TEST_3}: inputs above {record.counts_min:g} "
            "counts (line), those missed (dashed), by input counts; detections without a listed input (dotted), by "
            "measured counts. As in the paper, input counts are before vignetting and measured counts after it: at "
            "10′ half of them are lost.",
            recovery_figure(results),
        )


def field_images(results: StudyResults, campaign: str, drawn: DrawnField) -> Any:
    """Photons, the inputs as a deep image, MR/1 and WAVDETECT images of a random field."""
    deep_ks = drawn.cell.exposure_ks * DEEP_FACTOR
    images = {
        f"photons, {drawn.cell.exposure_ks:g} ks": drawn.photons,
        f"the inputs: {deep_ks:g} ks, no background": deep_image(drawn),
        "MR/1 filtered": searched_image(drawn, "mr1_se"),
        "WAVDETECT and its detections": searched_image(drawn, "wavdetect"),
    }
    figure, grid = image_sheet(images, drawn, HALF_WIDTH_ARCMIN)
    for axes in grid.flat:
        region_circle(axes, drawn.record.region_arcmin)
    mark_detections(grid[1][1], results, campaign, "wavdetect", drawn.grid)
    return figure


def recovery(results: StudyResults, label: str) -> Recovery:
    """What became of the inputs with one procedure."""
    rows = matches(results, TEST_3, label)
    radius_arcsec = results.run(TEST_3).data.cells[0].radius_arcsec
    near = links(results, TEST_3, label)
    near = near[near["in_list"].astype(bool) & (near["sep_arcsec"] <= radius_arcsec)]
    n_inputs = near.groupby(["realisation", "det_id"]).size().rename("n_inputs").reset_index()
    columns = ["realisation", "det_id", "counts_onaxis", "counts_expected", "counts", "sep_arcsec"]
    matched = rows.loc[rows["status"] == "matched", columns]
    matched = matched.rename(columns={"counts_onaxis": "counts_in", "counts": "counts_out"})
    if len(n_inputs):
        matched = matched.merge(n_inputs, how="left", on=["realisation", "det_id"], validate="one_to_one")
    else:
        matched = matched.assign(n_inputs=1)
    is_missed = rows["status"] == "missed"
    is_input = is_missed | (rows["status"] == "matched")
    return Recovery(
        matched,
        rows.loc[is_input, "counts_onaxis"].to_numpy(np.float64),
        rows.loc[is_missed, "counts_onaxis"].to_numpy(np.float64),
        rows.loc[rows["status"].isin(FALSE_STATUSES), "counts"].to_numpy(np.float64),
    )


def recovery_figure(results: StudyResults) -> Figure:
    """A scatter plot with histograms below it for each procedure."""
    shown = procedures(results, TEST_3)
    n_columns = min(3, len(shown))
    n_rows = -(-len(shown) // n_columns)
    heights = ((*BLOCK_HEIGHTS, SPACE_HEIGHT) * n_rows)[:-1]
    figure, grid = sheet(
        (len(heights), n_columns), (2.9, float(np.mean(heights))), heights=heights, gaps=(0.2, 0.1),
        margins=(0.7, 0.15, 0.3, 0.85), share_x=True, share_y="row",
    )  # fmt: skip
    for axes in grid[2::3].flat:
        axes.set_axis_off()
    for place in range(n_rows * n_columns):
        above, below = (grid[3 * (place // n_columns) + k][place % n_columns] for k in (0, 1))
        if place >= len(shown):
            above.set_axis_off()
            below.set_axis_off()
            continue
        found = recovery(results, shown[place].label)
        _scatter(above, found, shown[place])
        _histograms(below, found, shown[place], results.n_fields(TEST_3))
        if place % n_columns == 0:
            above.set_ylabel("detected counts")
            below.set_ylabel("per field")
    for axes in grid[-1]:
        axes.set_xlabel(INPUT_COUNTS_LABEL)
    legend_below(figure, _handles(), 5)
    return figure


def side_texts(matched: DataFrame) -> list[str]:
    """Mean (st.dev.) of output over input counts below and above 50 input counts: first field | all fields.

    The third one divides by the vignetted input counts.
    """
    bright, first = matched["counts_in"] >= BRIGHT_COUNTS, matched["realisation"] == FIRST
    texts = []
    for side, sign, true in (
        (~bright, f"< {BRIGHT_COUNTS:g}", "counts_in"),
        (bright, f"≥ {BRIGHT_COUNTS:g}", "counts_in"),
        (bright, f"≥ {BRIGHT_COUNTS:g} (v)", "counts_expected"),
    ):
        ratio = matched["counts_out"] / matched[true]
        texts.append(f"{sign}: {mean_text(ratio[side & first])} | {mean_text(ratio[side])}")
    return texts


def _scatter(axes: Any, found: Recovery, chosen: Procedure) -> None:
    matched = found.matched
    first = matched["realisation"] == FIRST
    cloud = thinned(matched[~first], CLOUD_MAX)
    axes.scatter(cloud["counts_in"], cloud["counts_out"], s=2.5, c=PALE, linewidths=0, rasterized=True, zorder=2)
    image = matched[first]
    colour = np.where(
        image["sep_arcsec"] > FAR_ARCSEC, "#000000", np.where(image["n_inputs"] > 1, "#8c8c8c", chosen.look.colour)
    )
    axes.scatter(
        image["counts_in"], image["counts_out"], s=17.0, c=list(colour), edgecolors="white", linewidths=0.4, zorder=3
    )
    equality_lines(axes, *COUNTS_LIMITS)
    axes.axvline(BRIGHT_COUNTS, color=GUIDE, ls=DOTTED, lw=1.2, zorder=1)
    axes.set(xlim=COUNTS_LIMITS, ylim=COUNTS_LIMITS, xscale="log")
    log_x(axes, as_powers=False)
    log_y(axes)
    axes.set_title(chosen.label, loc="left")
    note(axes, 0.02, 0.98, "\n".join(side_texts(matched)))


def _histograms(axes: Any, found: Recovery, chosen: Procedure, n_fields: int) -> None:
    edges = COUNTS_BINS.edges
    kinds = ((found.inputs, INPUT_COLOUR, "-"), (found.missed, INPUT_COLOUR, (0, (3, 2))),
             (found.false, chosen.look.colour, (0, (1, 1))))  # fmt: skip
    for values, colour, line in kinds:
        axes.stairs(COUNTS_BINS.count(values)[:-1] / n_fields, edges, color=colour, ls=line, lw=1.3)
    axes.axvline(BRIGHT_COUNTS, color=GUIDE, ls=DOTTED, lw=1.2, zorder=1)
    axes.set_ylim(bottom=0.0)


def _handles() -> list[Any]:
    circle = {"marker": "o", "ls": "none", "ms": 5.0, "mew": 0.0}
    return [
        handle("first field, in colour", color=GUIDE, **{**circle, "mfc": "#0072B2"}),
        handle(f"offset > {FAR_ARCSEC:g}″", color="#000000", **circle),
        handle("several inputs", color="#8c8c8c", **circle),
        handle("other fields", color=PALE, **{**circle, "ms": 2.5}),
        handle("factor of two", color=GUIDE, ls=DASHED, lw=0.8),
        handle("inputs", color=INPUT_COLOUR, lw=1.3),
        handle("missed", color=INPUT_COLOUR, ls=(0, (3, 2)), lw=1.3),
        handle("false", color=GUIDE, ls=(0, (1, 1)), lw=1.3),
    ]
