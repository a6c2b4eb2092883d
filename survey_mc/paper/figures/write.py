"""A figure as files: PNG to look at, PDF to print; the same bytes every time."""

from __future__ import annotations

import io
from pathlib import Path

from survey_mc.fits.writing import write_whole
from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.sheet import drawing
from survey_mc.report.figures.style import png_of

PDF_DOTS_PER_INCH = 150  # of the layers that are drawn as pixels
# Neither the time nor the version of a library: what a figure shows alone decides its bytes.
PDF_METADATA = {"CreationDate": None, "Creator": None, "Producer": None}


def write_figure(figure: PaperFigure, folder: Path) -> tuple[Path, Path]:
    """Write <name>.png and <name>.pdf into an existing folder, replacing what is there; their paths."""
    png, pdf = (folder / f"{figure.name}.{kind}" for kind in ("png", "pdf"))
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with drawing():
        FigureCanvasAgg(figure.figure)  # a figure made without a canvas has none that can give pixels
        write_whole(png, png_of(figure.figure), overwrite=True)
        write_whole(pdf, pdf_of(figure), overwrite=True)
    return png, pdf


def pdf_of(figure: PaperFigure) -> bytes:
    """PDF bytes of a figure."""
    buffer = io.BytesIO()
    figure.figure.savefig(buffer, format="pdf", dpi=PDF_DOTS_PER_INCH, metadata=PDF_METADATA)
    return buffer.getvalue()
