"""The stages of one field, each a function of its inputs and of its key alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from survey_mc.campaign import Campaign, Cell, CellMethod
from survey_mc.campaign.inputs import located_params
from survey_mc.campaign.keys import realisation_key
from survey_mc.columns import DETECTIONS, LINKS, MATCHES, TRUTH, Table
from survey_mc.detect import DETECTORS, check_detections
from survey_mc.match import Matched, match_field
from survey_mc.rng import stream
from survey_mc.store.layout import StoredTable
from survey_mc.types import Field, Skip

if TYPE_CHECKING:
    from pandas import DataFrame


def method_choice_params(campaign: Campaign, method: CellMethod) -> object:
    """Parameters of a cell's method, with the files they name in their places."""
    params = next(choice.params for choice in campaign.method if choice.label == method.label)
    return located_params(campaign, params)


def table_of(table: StoredTable, method_name: str = "") -> Table:
    """Declared columns of a stored table; detections carry the method's own columns too."""
    if table == "detections":
        return DETECTIONS.with_columns(DETECTORS[method_name].extra_columns)
    return {"truth": TRUTH, "matches": MATCHES, "links": LINKS}[table]


def detect_on(campaign: Campaign, method: CellMethod, field: Field, realisation: int) -> DataFrame | Skip:
    """Run one method on the observation of a field; the result is checked against the detector contract."""
    detector = DETECTORS[method.name]
    rng = stream(realisation_key(method.detect_key, realisation), "detect")
    found = detector.detect(field.observation, method_choice_params(campaign, method), rng)
    return found if isinstance(found, Skip) else check_detections(detector, field.observation, found)


def match_on(campaign: Campaign, cell: Cell, field: Field, detections: DataFrame) -> Matched:
    """Match the detections of one method with the truth of the field, by both rules."""
    return match_field(field, detections, campaign.match, cell.counts_min)


def stored_truth(field: Field) -> DataFrame:
    """The truth that is kept: every source that can give photons. Those outside the field of view cannot."""
    truth = field.truth
    return truth[(truth["counts_expected"] > 0.0) | (truth["counts_drawn"] > 0)]


def stack(rows: list[tuple[int, DataFrame]], table: Table) -> DataFrame:
    """One frame with the `realisation` column from frames of single realisations, in the order given."""
    import pandas as pd

    names = list(table.names[1:])
    # Frames without rows may carry columns without type; they must not spoil those of the others.
    frames = [frame for _, frame in rows if len(frame)] or [frame for _, frame in rows[:1]]
    stacked = pd.concat(frames, ignore_index=True)[names]
    numbers = np.array([number for number, _ in rows], dtype=np.int32)
    stacked.insert(0, "realisation", np.repeat(numbers, [len(frame) for _, frame in rows]))
    return stacked
