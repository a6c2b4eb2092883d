"""One field of a run to look at: drawn again, with what every method found on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from survey_mc.campaign import Campaign, draw_field, expand
from survey_mc.detect import DETECTORS
from survey_mc.report.source import FieldPicture
from survey_mc.store import CellRecord, RunData, read_piece
from survey_mc.store.layout import StoredTable

if TYPE_CHECKING:
    from pandas import DataFrame


def field_picture(data: RunData, campaign: Campaign) -> FieldPicture | None:
    """The first realisation of the first cell for which every method has a result; None if there is none."""
    labels = tuple(method.label for method in data.methods)
    for index, cell in enumerate(data.cells):
        matches = {label: _first_rows(data, cell, "matches", label) for label in labels}
        detections = {label: _first_rows(data, cell, "detections", label) for label in labels}
        if any(frame is None for frame in (*matches.values(), *detections.values())):
            continue
        drawn = draw_field(campaign, expand(campaign)[index], 0)
        views = {}
        # by place: a label of the run is the one it was made with, whatever the default is now
        for label, choice in zip(labels, campaign.method, strict=True):
            view = DETECTORS[choice.name].view
            if view is not None:
                views[label] = view(drawn.observation, choice.params)
        return FieldPicture(
            title=f"{cell.label}, realisation 0",
            observation=drawn.observation,
            truth=drawn.truth,
            detections={label: frame for label, frame in detections.items() if frame is not None},
            matches={label: frame for label, frame in matches.items() if frame is not None},
            views=views,
            region_arcmin=cell.region_arcmin,
            rule=cell.rule,
        )
    return None


def _first_rows(data: RunData, cell: CellRecord, table: StoredTable, label: str) -> DataFrame | None:
    """Rows of realisation 0, or None if it is not stored."""
    for record in data.manifest.records(cell.family(table, label)):
        if record.piece.start == 0:
            frame = read_piece(data.layout, record)
            return frame[frame["realisation"] == 0].drop(columns="realisation").reset_index(drop=True)
    return None
