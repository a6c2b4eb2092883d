"""What became of every detection and every source: one row each, for each rule.

Idea     a full outer join. Scope is decided once, after matching over the whole image: a matched pair is in scope if
         its source is inside the region, any other detection if it is inside itself.
Limits   a detection out of scope keeps a row (`outside`) with the source it went to; a source out of scope has none.

Invariants: matched + missed = listed sources inside; rows other than missed = detections; a source is matched once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.columns import MATCHES
from survey_mc.match.catalogue import Detections, Sources

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.match.origin import Origins

STATUSES = ("matched", "duplicate", "faint", "blend", "spurious", "outside", "missed")
MATCHED, DUPLICATE, FAINT, BLEND, SPURIOUS, OUTSIDE, MISSED = range(len(STATUSES))
MATCH_NAMES = tuple(name for name in MATCHES.names if name != "realisation")

SOURCE_FACTS = {
    "flux_true_cgs": "flux_cgs",
    "counts_onaxis": "counts_onaxis",
    "counts_expected": "counts_expected",
    "counts_drawn": "counts_drawn",
    "offaxis_true_arcmin": "offaxis_arcmin",
}
DETECTION_FACTS = ("counts", "counts_err", "flux_cgs", "offaxis_arcmin", "significance", "r50_arcsec")


@dataclass(frozen=True, slots=True)
class Verdicts:
    """Of each detection: its status code (place in `STATUSES`) and the source it concerns (-1: none)."""

    status: NDArray[np.int8]
    source: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Rows:
    """The outer join in numbers: rows of one rule, -1 where a partner is missing."""

    status: NDArray[np.int8]
    detection: NDArray[np.int64]
    source: NDArray[np.int64]


def in_scope(verdicts: Verdicts, detections: Detections, sources: Sources) -> Rows:
    """Detections in the order of det_id, those out of scope `outside`; then the missed sources by source_id."""
    status = verdicts.status.copy()
    is_matched = status == MATCHED
    inside = detections.is_inside.copy()
    inside[is_matched] = sources.is_inside[verdicts.source[is_matched]]
    status[~inside] = OUTSIDE
    is_missed = sources.is_listed & sources.is_inside
    is_missed[verdicts.source[is_matched]] = False
    missed = np.flatnonzero(is_missed)
    return Rows(
        np.concatenate((status, np.full(len(missed), MISSED, dtype=np.int8))),
        np.concatenate((np.arange(len(status)), np.full(len(missed), -1))),
        np.concatenate((verdicts.source, missed)),
    )


def match_frame(
    rows_of: dict[str, Rows],
    origins: Origins,
    separations: dict[str, NDArray[np.float64]],
    truth: DataFrame,
    detections: DataFrame,
) -> DataFrame:
    """The matches table of one field, without `realisation`: the rows of each rule in turn.

    separations: by rule, (n_detections,). detections: in the order of det_id.
    """
    import pandas as pd

    detection = np.concatenate([rows.detection for rows in rows_of.values()])
    source = np.concatenate([rows.source for rows in rows_of.values()])
    status = np.concatenate([rows.status for rows in rows_of.values()])
    n_rows = [len(rows.status) for rows in rows_of.values()]
    columns: dict[str, object] = {
        "rule": _texts(tuple(rows_of), np.repeat(np.arange(len(rows_of)), n_rows)),
        "status": _texts(STATUSES, status.astype(np.int64)),
        "source_id": source.astype(np.int32),
        "det_id": _taken(detections["det_id"].to_numpy(np.int32), detection, -1),
        "sep_arcsec": np.concatenate(
            [_taken(separations[rule], rows.detection, np.nan) for rule, rows in rows_of.items()]
        ),
        "n_main": _taken(origins.n_main.astype(np.int32), detection, 0),
        "n_second": _taken(origins.n_second.astype(np.int32), detection, 0),
        "n_background": _taken(origins.n_background.astype(np.int32), detection, 0),
        "main_source_id": _taken(origins.main_source.astype(np.int32), detection, -1),
        "second_source_id": _taken(origins.second_source.astype(np.int32), detection, -1),
        "is_blend": _taken(origins.is_blend, detection, False),
    }
    columns["kind_true"] = truth["kind"].array.take(source, allow_fill=True, fill_value="")
    for name, truth_name in SOURCE_FACTS.items():
        columns[name] = _taken(truth[truth_name].to_numpy(), source, 0 if name == "counts_drawn" else np.nan)
    for name in DETECTION_FACTS:
        columns[name] = _taken(detections[name].to_numpy(), detection, np.nan)
    return pd.DataFrame({name: columns[name] for name in MATCH_NAMES}, copy=False)


def _texts(words: tuple[str, ...], code: NDArray[np.int64]) -> object:
    """words[code] in the text type of the installed pandas."""
    import pandas as pd

    return pd.Series(list(words)).array.take(code)


def _taken(values: NDArray[np.generic], row: NDArray[np.int64], missing: object) -> NDArray[np.generic]:
    """values[row], and `missing` where the row is -1."""
    taken = np.full(len(row), missing, dtype=values.dtype)
    known = row >= 0
    taken[known] = values[row[known]]
    return taken
