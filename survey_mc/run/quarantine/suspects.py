"""What earlier runs died at, put into the orders that come to it again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from survey_mc.campaign import Cell
from survey_mc.run.order import Order, Suspect
from survey_mc.run.quarantine.attempts import deaths, forget
from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.store import RunLayout

Suspects = Mapping[str, list[Suspect]]  # by field key


def find_suspects(layout: RunLayout, cells: tuple[Cell, ...]) -> Suspects:
    """Read the notes that dead processes left in a run directory, and remove them.

    A place of other parameters than the campaign has now concerns nobody. What took too long is tried again: the limit
    may be another one now.
    """
    field_keys = {cell.field_key: (cell.field_key, "") for cell in cells}
    detect_keys = {m.detect_key: (cell.field_key, m.label) for cell in cells for m in reversed(cell.methods)}
    found: dict[str, list[Suspect]] = {}
    for death in deaths(layout.attempts):
        place = death.place
        if place is not None and place.key in field_keys | detect_keys:
            field_key, label = (field_keys | detect_keys)[place.key]
            found.setdefault(field_key, []).append(Suspect(place.realisation, label, False, death.trace))
    forget(layout.attempts)
    return found


def equipped(order: Order, cell: Cell, limits: FieldLimits, suspects: Suspects, versions: Mapping[str, str]) -> Order:
    """An order with all that its worker has to know."""
    here = tuple(s for s in suspects.get(cell.field_key, ()) if order.start <= s.realisation < order.stop)
    return replace(order, limits=limits, suspects=here, versions=versions)
