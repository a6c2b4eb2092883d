"""One field of a campaign by its numbers: to look at, or to replay what a method did on it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.campaign import Campaign, Cell, draw_field, expand, load_campaign
from survey_mc.errors import BadInput
from survey_mc.registry import UnknownName
from survey_mc.run.stages import detect_on, match_on
from survey_mc.types import Field, Skip

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.match import Matched


@dataclass(frozen=True, slots=True)
class Replayed:
    """What a method gives on a field now: its detections and their matches."""

    field: Field
    detections: DataFrame
    matched: Matched


def pick_cell(campaign: Campaign, index: int) -> Cell:
    """Cell number `index` of a campaign."""
    cells = expand(campaign)
    if not 0 <= index < len(cells):
        names = ", ".join(f"{cell.index}: {cell.label}" for cell in cells[:20])
        raise BadInput(campaign.name, f"--cell must be 0..{len(cells) - 1} (got {index}); {names}")
    return cells[index]


def simulate_field(campaign: Campaign | Path | str, cell: int = 0, realisation: int = 0) -> Field:
    """Draw one field of a campaign: the same photons as in its runs. realisation may exceed the campaign's number."""
    if not isinstance(campaign, Campaign):
        campaign = load_campaign(campaign)
    _check_realisation(campaign, realisation)
    return draw_field(campaign, pick_cell(campaign, cell), realisation)


def _check_realisation(campaign: Campaign, realisation: int) -> None:
    if realisation < 0:
        raise BadInput(campaign.name, f"--realisation must be 0 or more (got {realisation})")


def replay(campaign: Campaign, cell: Cell, method_label: str, realisation: int) -> Replayed:
    """Draw, detect and match one field again; exceptions of the method come through as they are."""
    method = next((m for m in cell.methods if m.label == method_label), None)
    if method is None:
        raise UnknownName("method", method_label, [m.label for m in cell.methods])
    _check_realisation(campaign, realisation)
    field = draw_field(campaign, cell, realisation)
    found = detect_on(campaign, method, field, realisation)
    if isinstance(found, Skip):
        raise BadInput(method_label, f"skips this field: {found.reason}")
    return Replayed(field, found.frame(), match_on(campaign, cell, field, found))
