"""Fields of the tests drawn again, and how their images are shown: photons, filtered images, made-up deep images.

Idea     the first realisation of a campaign stands for the paper's image: the same photons as in the run. The filtered
         images are those the procedures search, with the campaign's parameters.
Source   paper Figs. "test1:sum", "test2:sum", "test3:sum", "test4:sum".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc.campaign import Campaign, Cell, draw_field, expand, load_run_campaign
from survey_mc.campaign.draw import draw_truth
from survey_mc.campaign.inputs import located_params
from survey_mc.campaign.keys import realisation_key
from survey_mc.detect import DETECTORS
from survey_mc.paper.figures.rows import FIRST, cell, detections, procedure
from survey_mc.paper.figures.sheet import sheet
from survey_mc.paper.results import StudyResults
from survey_mc.report.figures.style import COLOUR_OF
from survey_mc.rng import stream
from survey_mc.telescope.expose import expose
from survey_mc.telescope.response import build_response
from survey_mc.types import Field, FloatArray, FloatImage, PixelGrid, Sky
from survey_mc.units import ARCSEC_PER_ARCMIN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from survey_mc.store import CellRecord

DEEP_FACTOR = 100.0  # of the exposure in the picture of the inputs
DEEP_COUNTS_MIN = 10.0  # in the exposure of the test
BRIGHT_SHARE = {True: 0.995, False: 0.9985}  # of the photons' pixels that hold some, of a filtered image: below black
PANEL_INCHES = 3.46  # 450 pixels of a PNG: one for each pixel of a field of view 30′ across
REGION_STYLE: dict[str, Any] = {"ec": "#333333", "lw": 1.0, "ls": (0, (5, 3))}
BASE_SHARE = 0.7  # of the pixels of a filtered image are white


@dataclass(frozen=True, slots=True)
class DrawnField:
    """The first field of a cell, drawn again from its keys."""

    campaign: Campaign
    cell: Cell
    record: CellRecord
    field: Field

    @property
    def grid(self) -> PixelGrid:
        return self.field.observation.grid

    @property
    def photons(self) -> FloatImage:
        return np.asarray(self.field.observation.counts, dtype=np.float64)


def first_field(
    results: StudyResults, campaign: str, band: str = "soft", exposure_ks: float | None = None
) -> DrawnField:
    """Draw the field that stands for the paper's image."""
    data = results.run(campaign).data
    record = cell(results, campaign, band, exposure_ks)
    loaded = load_run_campaign(data.layout.root)
    chosen = expand(loaded)[[c.label for c in data.cells].index(record.label)]
    return DrawnField(loaded, chosen, record, draw_field(loaded, chosen, FIRST))


def deep_image(drawn: DrawnField) -> FloatImage:
    """The same sky in a much longer exposure without background; only sources above the count limit are kept."""
    sky = draw_truth(drawn.campaign, drawn.cell, FIRST)
    bright = sky.source_rows["rate_cps"] * drawn.cell.exposure_s > DEEP_COUNTS_MIN
    settings = drawn.campaign.instrument.model_copy(update={"background": False})
    response = build_response(settings, drawn.cell.band, drawn.cell.exposure_s * DEEP_FACTOR)
    key = realisation_key(drawn.cell.field_key, FIRST) + "/deep"
    kept = Sky(sky.source_rows.where(bright), sky.images)
    return np.asarray(expose(kept, response, partial(stream, key), key).observation.counts, dtype=np.float64)


def searched_image(drawn: DrawnField, name: str) -> FloatImage | None:
    """The filtered image a procedure searches, with the campaign's parameters; None if it takes no part."""
    choice = next((m for m in drawn.campaign.method if m.name == name), None)
    view = DETECTORS[name].view
    if choice is None or view is None:
        return None
    return view(drawn.field.observation, located_params(drawn.campaign, choice.params))


def smoothing_arcsec(drawn: DrawnField) -> float:
    """FWHM of the Gaussian of the campaign's G+SE; NaN if it takes no part."""
    choice = next((m for m in drawn.campaign.method if m.name == "gauss_se"), None)
    return float(getattr(choice.params, "fwhm_arcsec", np.nan)) if choice else float("nan")


def image_sheet(images: dict[str, FloatImage | None], drawn: DrawnField, half_arcmin: float) -> tuple[Figure, Any]:
    """Images two by two, in arcmin from the optical axis; one that does not exist leaves a word."""
    n_rows = -(-len(images) // 2)
    figure, grid = sheet(
        (n_rows, 2), (PANEL_INCHES, PANEL_INCHES), margins=(0.62, 0.12, 0.3, 0.5), gaps=(0.2, 0.32),
        share_x=True, share_y=True,
    )  # fmt: skip
    for axes, (title, image) in zip(grid.flat, images.items(), strict=True):
        axes.set_title(title, loc="left")
        if image is None:
            axes.text(0.5, 0.5, "not part of this run", transform=axes.transAxes, ha="center")
        else:
            show_image(axes, image, drawn.grid)
        axes.set(xlim=(-half_arcmin, half_arcmin), ylim=(-half_arcmin, half_arcmin), aspect="equal")
    label_arcmin(grid)
    return figure, grid


def label_arcmin(grid: Any) -> None:
    """Names of the axes, at the outer panels only."""
    for axes in grid[-1]:
        axes.set_xlabel("x from the axis (arcmin)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y from the axis (arcmin)")


def show_image(axes: Any, image: FloatImage, grid: PixelGrid) -> None:
    """Dark where there are photons, by the square root of their number; a filtered image above its background."""
    from matplotlib.colors import PowerNorm

    scale = grid.scale_arcsec / ARCSEC_PER_ARCMIN
    left, bottom = (scale * (-0.5 - grid.axis_pix[i]) for i in (0, 1))
    extent = (left, left + scale * image.shape[1], bottom, bottom + scale * image.shape[0])
    seen = image[image > 0.0]
    is_photons = bool(np.all(seen == np.rint(seen)))
    base = 0.0 if is_photons else float(np.quantile(seen, BASE_SHARE))
    top = float(np.quantile(seen, BRIGHT_SHARE[is_photons])) if seen.size else 1.0
    norm = PowerNorm(0.5, vmin=base, vmax=max(top, base + 1e-12), clip=True)
    axes.imshow(image, origin="lower", extent=extent, cmap="gray_r", norm=norm, interpolation="none")
    axes.grid(visible=False)


def arcmin_of(grid: PixelGrid, x_pix: FloatArray, y_pix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixel positions in arcmin from the optical axis."""
    scale = grid.scale_arcsec / ARCSEC_PER_ARCMIN
    return (x_pix - grid.axis_pix[0]) * scale, (y_pix - grid.axis_pix[1]) * scale


def mark_detections(axes: Any, results: StudyResults, campaign: str, name: str, grid: PixelGrid) -> None:
    """A small circle at every detection of a procedure in the field that is shown."""
    chosen = procedure(results, campaign, name)
    if chosen is None:
        return
    found = detections(results, campaign, chosen.label)
    found = found[found["realisation"] == FIRST]
    x, y = arcmin_of(grid, found["x_pix"].to_numpy(np.float64), found["y_pix"].to_numpy(np.float64))
    axes.scatter(x, y, s=26, marker="o", facecolors="none", edgecolors=COLOUR_OF[name], linewidths=0.9)


def region_circle(axes: Any, radius_arcmin: float, **style: Any) -> None:
    """A circle around the optical axis."""
    from matplotlib.patches import Circle

    axes.add_patch(Circle((0.0, 0.0), radius_arcmin, fill=False, **{**REGION_STYLE, **style}))
