"""One field to look at: the photons, what each method filters, and what became of sources and detections."""

from __future__ import annotations

from typing import Any

import numpy as np

from survey_mc.report.figures.panels import panel_grid
from survey_mc.report.figures.style import BLUE, ORANGE, PURPLE, SETTINGS, VERMILLION, Figure, literal, png_of
from survey_mc.report.source import FieldPicture
from survey_mc.types import FloatArray
from survey_mc.units import ARCSEC_PER_ARCMIN

STATUS_MARK = {
    "matched": ("o", "#00b894"),
    "duplicate": ("s", ORANGE),
    "faint": ("D", BLUE),
    "blend": ("p", PURPLE),
    "spurious": ("X", VERMILLION),
    "missed": ("o", "#d00000"),
}
SCALE_BAR_ARCMIN = 5.0
SMOOTHING_PIX = 1.5
DASHED = (0, (2, 1.5))
MARGIN = 1.05
PANEL_INCHES = (4.0, 4.0)
LEFT_INCHES, RIGHT_INCHES = (0.75, 1.5), 0.8  # the colour bar is right of its image
BAR_PLACE = (1.03, 0.05, 0.035, 0.9)  # x, y, width, height in units of the image
BAR_TICKS = 5
BRIGHT_SHARE = 0.995  # of the non-empty pixels are below white


def field_figures(picture: FieldPicture) -> list[Figure]:
    """The raw and filtered images, then one annotated image for each method."""
    figures = [_image_figure(picture)]
    if picture.matches:
        figures.append(_outcome_figure(picture))
    return figures


def _image_figure(picture: FieldPicture) -> Figure:
    images = {"photons": np.asarray(picture.observation.counts, dtype=float), **picture.views}

    def draw(figure: Any, axes: Any, title: str) -> None:
        unit = "counts per pixel" if title == "photons" else "filtered, counts per pixel"
        shown = _draw_image(picture, axes, images[title])
        _colour_bar(figure, axes, shown, unit)

    png = _image_panels(list(images), draw)
    caption = (
        f"{picture.title}. The photon image as drawn, and the images that the methods search. Grey levels follow "
        "the square root of the counts. Circle: the analysed region; black: not observed or nothing."
    )
    return Figure("field_images", "One field: photons and filtered images", png, caption)


def _outcome_figure(picture: FieldPicture) -> Figure:
    from scipy.ndimage import gaussian_filter

    smooth = gaussian_filter(np.asarray(picture.observation.counts, dtype=float), SMOOTHING_PIX)

    def draw(figure: Any, axes: Any, title: str) -> None:
        shown = _draw_image(picture, axes, smooth)
        _colour_bar(figure, axes, shown, "smoothed counts per pixel")
        _draw_outcomes(picture, axes, title)

    png = _image_panels(list(picture.matches), draw)
    caption = (
        f"{picture.title}, with the outcome of every source and detection inside the region ({picture.rule} rule): "
        "matched (green circle), duplicate (orange square), faint (blue diamond), blend (purple pentagon) and spurious "
        f"(vermillion cross) at the detection; missed sources as dashed red circles. Smoothed by {SMOOTHING_PIX:g} pix."
    )
    return Figure("field_outcomes", "One field: what was found, missed and made up", png, caption)


def _image_panels(titles: list[str], draw: Any) -> bytes:
    import matplotlib as mpl

    n_columns = min(2, len(titles))
    n_rows = -(-len(titles) // n_columns)
    with mpl.rc_context({**SETTINGS, "axes.grid": False}):
        figure, grid = panel_grid((n_rows, n_columns), PANEL_INCHES, LEFT_INCHES, RIGHT_INCHES)
        handles: dict[str, Any] = {}
        for axes, title in zip(grid.flat, titles, strict=False):
            draw(figure, axes, title)
            axes.set_title(literal(title), loc="left", y=1.0)
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        for axes in grid.flat[len(titles) :]:
            axes.set_axis_off()
        if handles:
            figure.legend(handles.values(), handles.keys(), loc="lower center", ncols=len(handles))
        return png_of(figure)


def _colour_bar(figure: Any, axes: Any, shown: Any, label: str) -> None:
    """The grey levels beside an image; ticks at round numbers that are on the scale."""
    from matplotlib.ticker import MaxNLocator

    top = shown.norm.vmax
    ticks = [t for t in MaxNLocator(BAR_TICKS).tick_values(0.0, top) if 0.0 <= t <= top]
    figure.colorbar(shown, cax=axes.inset_axes(BAR_PLACE), ticks=ticks, label=label)


def _draw_image(picture: FieldPicture, axes: Any, image: FloatArray) -> Any:
    """Image in arcmin from the optical axis, cut to the region, with its circle and a scale bar."""
    from matplotlib.colors import PowerNorm
    from matplotlib.patches import Circle

    grid = picture.observation.grid
    scale = grid.scale_arcsec / ARCSEC_PER_ARCMIN
    left, bottom = (scale * (-0.5 - grid.axis_pix[i]) for i in (0, 1))
    extent = (left, left + scale * image.shape[1], bottom, bottom + scale * image.shape[0])
    positive = image[image > 0]
    top = float(np.quantile(positive, BRIGHT_SHARE)) if positive.size else 1.0
    norm = PowerNorm(0.5, vmin=0.0, vmax=max(top, 1e-12), clip=True)
    shown = axes.imshow(image, origin="lower", extent=extent, cmap="gray", norm=norm, interpolation="nearest")
    axes.add_patch(Circle((0, 0), picture.region_arcmin, fill=False, ec="#ffe066", lw=0.9))
    half = picture.region_arcmin * MARGIN
    x_low, x_high = max(extent[0], -half), min(extent[1], half)
    y_low, y_high = max(extent[2], -half), min(extent[3], half)
    axes.set(xlim=(x_low, x_high), ylim=(y_low, y_high), aspect="equal")
    axes.set_xlabel("x from the axis (′)")
    axes.set_ylabel("y from the axis (′)")
    bar = min(SCALE_BAR_ARCMIN, 0.25 * (x_high - x_low))
    x_bar, y_bar = x_low + 0.04 * (x_high - x_low), y_low + 0.04 * (y_high - y_low)
    axes.plot([x_bar, x_bar + bar], [y_bar, y_bar], color="white", lw=2.5, solid_capstyle="butt")
    axes.annotate(f"{bar:.3g}′", (x_bar + bar / 2, y_bar), (0, 3), textcoords="offset points", color="white",
                  ha="center", fontsize=8)  # fmt: skip
    return shown


def _draw_outcomes(picture: FieldPicture, axes: Any, label: str) -> None:
    """Marks of the headline rule; a mark is at the detection, or at the source if that was missed."""
    grid = picture.observation.grid
    matches = picture.matches[label]
    matches = matches[matches["rule"] == picture.rule]
    detections = picture.detections[label].set_index("det_id")
    sources = picture.truth.set_index("source_id")
    for status, (marker, colour) in STATUS_MARK.items():
        style: Any = DASHED if status == "missed" else "-"
        rows = matches[matches["status"] == status]
        if status == "missed":
            places = sources.loc[rows["source_id"], ["x_pix", "y_pix"]]
        else:
            places = detections.loc[rows["det_id"], ["x_pix", "y_pix"]]
        x, y = (
            (places.to_numpy(float)[:, i] - grid.axis_pix[i]) * grid.scale_arcsec / ARCSEC_PER_ARCMIN for i in (0, 1)
        )
        axes.scatter(x, y, s=42, marker=marker, facecolors="none", edgecolors=colour, linewidths=1.1, linestyle=style,
                     label=f"{status}")  # fmt: skip
