"""How all figures look: one colour, marker and line for each method, everywhere.

Source   colours of Okabe & Ito 2008 ("Color Universal Design"), which stay apart for colour-blind readers.
Limits   seven colours: procedures beyond the known ones share them and differ in marker and line.
"""

from __future__ import annotations

import base64
import io
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from survey_mc.report.source import MethodLike

BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, YELLOW = (
    *("#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#B8A800"),
)
COLOURS = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, YELLOW)
COLOUR_OF = {
    "mr1_se": BLUE,
    "emldetect": VERMILLION,
    "gauss_se": GREEN,
    "wavdetect": ORANGE,
    "ewavelet": PURPLE,
    "vtpdetect": SKY,
    "eboxdetect": YELLOW,
}
MARKERS = "osD^vPX<>*"
LINES: tuple[Any, ...] = ("-", "--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))
INPUT_COLOUR = "#222222"
PALETTE_COLOURS = 256

DOTS_PER_INCH = 130
SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.edgecolor": "#555555",
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "xtick.direction": "in",
    "ytick.direction": "in",
    "figure.dpi": DOTS_PER_INCH,
    "savefig.dpi": "figure",
}


@dataclass(frozen=True, slots=True)
class Look:
    """The colour, marker and line of one method."""

    colour: str
    marker: str
    line: Any


@dataclass(frozen=True, slots=True)
class Figure:
    """One finished figure: PNG bytes, what it shows, and the tables its numbers are in (names)."""

    name: str
    title: str
    png: bytes
    caption: str
    tables: tuple[str, ...] = ()

    @property
    def data_uri(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


def looks(methods: Sequence[MethodLike]) -> dict[str, Look]:
    """Look of each method by label; a procedure's colour does not depend on which others take part.

    Several labels of one procedure share its colour and differ in marker and line.
    """
    used: dict[str, int] = {}
    result = {}
    for place, method in enumerate(methods):
        colour = COLOUR_OF.get(method.name, COLOURS[zlib.crc32(method.name.encode()) % len(COLOURS)])
        nth = used.get(colour, 0)
        used[colour] = nth + 1
        result[method.label] = Look(colour, MARKERS[place % len(MARKERS)], LINES[nth % len(LINES)])
    return result


def png_of(figure: Any) -> bytes:
    """PNG bytes of a matplotlib figure, without the time or the program's name in them.

    The canvas draws once; `savefig` would draw twice. A palette of 256 colours makes the file a third as large.
    """
    from PIL import Image  # matplotlib cannot do without it

    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
    buffer = io.BytesIO()
    picture.quantize(PALETTE_COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(buffer, "PNG")
    return buffer.getvalue()


def literal(text: str) -> str:
    """Text from people, shown as it is: a dollar sign is no mathematics."""
    return text.replace("$", r"\$")
