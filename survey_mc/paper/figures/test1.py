"""Test 1 of the paper: pairs of point sources."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from survey_mc.paper.figures.images import (
    DrawnField,
    first_field,
    image_sheet,
    mark_detections,
    searched_image,
    smoothing_arcsec,
)
from survey_mc.paper.figures.pairs import Member, pair_members, ratio_figure
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import FIRST, fields_phrase, truth
from survey_mc.paper.figures.sheet import drawing
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_1
from survey_mc.units import ARCSEC_PER_ARCMIN

HALF_WIDTH_ARCMIN = 9.0  # holds the pairs and their numbers
COLUMN_TITLE_ARCMIN, PAIR_TEXT_ARCMIN = 1.0, 0.85  # above and below the sources
WRITING = "#9a3d00"
ON_WHITE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}
MEMBERS = (
    Member("fixed", "s", "□", "members fixed at 100 counts"),
    Member("varying", "o", "●", "members that vary"),
)


def test1_figures(results: StudyResults) -> Iterator[PaperFigure]:
    """Images and count ratios."""
    with drawing():
        drawn = first_field(results, TEST_1)
        figure = pair_images(results, TEST_1, drawn)
        fwhm = smoothing_arcsec(drawn)
        yield PaperFigure(
            "test1_images",
            "Test 1: pairs of point sources, four images",
            f"The paper's Fig. 2. One image (the first of {TEST_1}) of pairs of point sources 15, 30 and 60″ apart, "
            f"{drawn.cell.exposure_ks:g} ks, 0.5-2 keV, no vignetting: photons with the input counts (fixed | "
            f"varying) below each pair, convolved with a Gaussian of FWHM {fwhm:g}″, filtered by MR/1, and "
            "WAVDETECT's image with its detections as circles. Square-root grey scale. The paper does not print the "
            "counts of the varying members in its text: the list is ours. WAVDETECT's panel is the smoothed image "
            "from which its cells are cut, not the image of its sources alone.",
            figure,
        )
        n_images = results.n_fields(TEST_1)
        yield PaperFigure(
            "test1_count_ratios",
            "Test 1: inferred over input counts",
            "The paper's Fig. 3. Ratio of measured to input counts of the two members of each pair, against the input "
            "counts of the member that varies. Squares: members fixed at 100 counts, set beside their neighbours; "
            "circles: those that vary; both for the first image, as the paper has one. An arrow with a number: above "
            f"2. Bars behind: median and 68 % of {fields_phrase(n_images, 'image')} of {TEST_1}, fixed members on the "
            "left. Numbers: sources found in the first image, mean and standard deviation of their ratios (both 0 "
            "where nothing is found), then the same for all images with the fraction found.",
            ratio_figure(results, TEST_1, MEMBERS),
        )


def pair_images(results: StudyResults, campaign: str, drawn: DrawnField) -> Any:
    """Photons with the inputs written in, Gaussian, MR/1 and WAVDETECT images."""
    images = {
        f"photons, {drawn.cell.exposure_ks:g} ks, input counts": drawn.photons,
        f"Gaussian, FWHM {smoothing_arcsec(drawn):g}″": searched_image(drawn, "gauss_se"),
        "MR/1 filtered": searched_image(drawn, "mr1_se"),
        "WAVDETECT and its detections": searched_image(drawn, "wavdetect"),
    }
    figure, grid = image_sheet(images, drawn, HALF_WIDTH_ARCMIN)
    _write_inputs(grid[0][0], results, campaign)
    mark_detections(grid[1][1], results, campaign, "wavdetect", drawn.grid)
    return figure


def _write_inputs(axes: Any, results: StudyResults, campaign: str) -> None:
    """Counts of the two members below each pair, separations above the columns."""
    sources = truth(results, campaign)
    sources = sources[sources["realisation"] == FIRST].reset_index(drop=True)
    members = pair_members(sources).assign(
        x=sources["x_arcsec"] / ARCSEC_PER_ARCMIN, y=sources["y_arcsec"] / ARCSEC_PER_ARCMIN
    )
    top = members["y"].max() + COLUMN_TITLE_ARCMIN
    style = {"ha": "center", "va": "center", "color": WRITING, "fontweight": "bold"}
    for separation, rows in members.groupby("separation_arcsec"):
        axes.text(rows["x"].mean(), top, f"{separation:g}″", fontsize=9.0, bbox=ON_WHITE, **style)
    for _, pair in members.sort_values("role").groupby("group_id"):
        counts = " | ".join(f"{n:g}" for n in pair["counts_in"])
        below = pair["y"].min() - PAIR_TEXT_ARCMIN
        axes.text(pair["x"].mean(), below, counts, fontsize=6.8, bbox=ON_WHITE, **style)
