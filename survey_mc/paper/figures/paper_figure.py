"""One figure of the paper, drawn again, with the words that belong under it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """name: file stem and anchor. caption: plain text, complete without the page around it."""

    name: str
    title: str
    caption: str
    figure: Figure
