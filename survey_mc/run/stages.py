"""The stages of one field, each a function of its inputs and of its key alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.array_frame import ArrayFrame
from survey_mc.campaign import Campaign, Cell, CellMethod
from survey_mc.campaign.inputs import located_params
from survey_mc.campaign.keys import realisation_key
from survey_mc.columns import DETECTIONS, LINKS, MATCHES, TRUTH, Table
from survey_mc.detect import DETECTORS
from survey_mc.detect.contract import checked_rows
from survey_mc.rng import stream
from survey_mc.store.layout import StoredTable
from survey_mc.types import Field, Skip

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.match import Matched


def method_choice_params(campaign: Campaign, method: CellMethod) -> object:
    """Parameters of a cell's method, with the files they name in their places."""
    params = next(choice.params for choice in campaign.method if choice.label == method.label)
    return located_params(campaign, params)


def table_of(table: StoredTable, method_name: str = "") -> Table:
    """Declared columns of a stored table; detections carry the method's own columns too."""
    if table == "detections":
        return DETECTIONS.with_columns(DETECTORS[method_name].extra_columns)
    return {"truth": TRUTH, "matches": MATCHES, "links": LINKS}[table]


def detect_on(campaign: Campaign, method: CellMethod, field: Field, realisation: int) -> ArrayFrame | Skip:
    """Run one method on the observation of a field; the result is checked against the detector contract."""
    detector = DETECTORS[method.name]
    rng = stream(realisation_key(method.detect_key, realisation), "detect")
    found = detector.detect(field.observation, method_choice_params(campaign, method), rng)
    return found if isinstance(found, Skip) else checked_rows(detector, field.observation, found)


def match_on(campaign: Campaign, cell: Cell, field: Field, detections: DataFrame | ArrayFrame) -> Matched:
    """Match the detections of one method with the truth of the field, by both rules."""
    from survey_mc.match import match_field  # loads the compiler, which a driver does without

    return match_field(field, detections, campaign.match, cell.counts_min)


def stored_truth(field: Field) -> ArrayFrame:
    """The truth that is kept: every source that can give photons. Those outside the field of view cannot."""
    truth = field.truth_rows
    return truth.where((truth["counts_expected"] > 0.0) | (truth["counts_drawn"] > 0))


def stack(parts: Sequence[tuple[int, DataFrame | ArrayFrame]], table: Table) -> ArrayFrame:
    """The rows of single realisations in the order given, with their `realisation`."""
    every = [part if isinstance(part, ArrayFrame) else ArrayFrame.of_frame(part) for _, part in parts]
    # Those without rows may have columns without type; they must not spoil the type of the others.
    columns = ArrayFrame.together([rows for rows in every if len(rows)] or every[:1]).columns
    numbers = np.array([number for number, _ in parts], dtype=np.int32)
    realisation = np.repeat(numbers, [len(rows) for rows in every])
    return ArrayFrame({"realisation": realisation} | {name: columns[name] for name in table.names[1:]})
