"""What became of every detection and every source: one row each, for each rule.

Idea     a full outer join. Scope is decided once, after matching over the whole image: a matched pair is in scope if
         its source is inside the region, any other detection if it is inside itself.
Limits   a detection out of scope keeps a row (`outside`) with the source it went to; a source out of scope has none.

Invariants: matched + missed = listed sources inside; rows other than missed = detections; a source is matched once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame, Texts
from survey_mc.columns import MATCHES
from survey_mc.match.catalogue import Detections, Sources

if TYPE_CHECKING:
    from survey_mc.match.origin import Origins

STATUSES = ("matched", "duplicate", "faint", "blend", "spurious", "outside", "missed")
MATCHED, DUPLICATE, FAINT, BLEND, SPURIOUS, OUTSIDE, MISSED = range(len(STATUSES))
MATCH_NAMES = tuple(name for name in MATCHES.names if name != "realisation")

SOURCE_FACTS = {
    "flux_true_cgs": "flux_cgs",
    "counts_onaxis": "counts_onaxis",
    "counts_expected": "counts_expected",
    "offaxis_true_arcmin": "offaxis_arcmin",
}
ORIGIN_FACTS = ("det_id", "n_main", "n_second", "n_background", "main_source_id", "second_source_id")
DETECTION_FACTS = ("counts", "counts_err", "flux_cgs", "offaxis_arcmin", "significance", "r50_arcsec")


@dataclass(frozen=True, slots=True)
class Verdicts:
    """Of each detection: its status code (place in `STATUSES`) and the source it concerns (-1: none)."""

    status: NDArray[np.int8]
    source: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Join:
    """The outer join in numbers: rows of one rule, -1 where a partner is missing."""

    status: NDArray[np.int8]
    detection: NDArray[np.int64]
    source: NDArray[np.int64]


def in_scope(verdicts: Verdicts, detections: Detections, sources: Sources) -> Join:
    """Detections in the order of det_id, those out of scope `outside`; then the missed sources by source_id."""
    status = verdicts.status.copy()
    is_matched = status == MATCHED
    inside = detections.is_inside.copy()
    inside[is_matched] = sources.is_inside[verdicts.source[is_matched]]
    status[~inside] = OUTSIDE
    is_missed = sources.is_listed & sources.is_inside
    is_missed[verdicts.source[is_matched]] = False
    missed = np.flatnonzero(is_missed)
    return Join(
        np.concatenate((status, np.full(len(missed), MISSED, dtype=np.int8))),
        np.concatenate((np.arange(len(status)), np.full(len(missed), -1))),
        np.concatenate((verdicts.source, missed)),
    )


def match_rows(
    joins: dict[str, Join],
    origins: Origins,
    separations: dict[str, NDArray[np.float64]],
    truth: ArrayFrame,
    detections: ArrayFrame,
) -> ArrayFrame:
    """The matches table of one field, without `realisation`: the rows of each rule in turn.

    separations: by rule, (n_detections,). detections: in the order of det_id.
    """
    detection = np.concatenate([join.detection for join in joins.values()])
    source = np.concatenate([join.source for join in joins.values()])
    status = np.concatenate([join.status for join in joins.values()])
    n_rows = [len(join.status) for join in joins.values()]
    found = _taken(detection, *((detections[name], np.nan) for name in DETECTION_FACTS))
    photons = _taken(
        detection,
        (detections["det_id"], -1),
        (origins.n_main, 0),
        (origins.n_second, 0),
        (origins.n_background, 0),
        (origins.main_source, -1),
        (origins.second_source, -1),
    )
    true = _taken(source, *((truth[name], np.nan) for name in SOURCE_FACTS.values()))
    columns: dict[str, NDArray[Any] | Texts] = {
        "rule": Texts(tuple(joins), np.repeat(np.arange(len(joins), dtype=np.int32), n_rows)),
        "status": Texts(STATUSES, status.astype(np.int32)),
        "source_id": source.astype(np.int32),
        "sep_arcsec": np.concatenate(
            [_taken(join.detection, (separations[rule], np.nan))[0] for rule, join in joins.items()]
        ),
        "is_blend": _taken(detection, (origins.is_blend, False))[0],
        "kind_true": truth.texts("kind").take(source),
        "counts_drawn": _taken(source, (truth["counts_drawn"], 0))[0],
        **dict(zip(ORIGIN_FACTS, photons.astype(np.int32), strict=True)),
        **dict(zip(SOURCE_FACTS, true, strict=True)),
        **dict(zip(DETECTION_FACTS, found, strict=True)),
    }
    return ArrayFrame({name: columns[name] for name in MATCH_NAMES})


def _taken(row: NDArray[np.int64], *columns: tuple[NDArray[Any], float]) -> NDArray[Any]:
    """(n_columns, n_rows) values of several columns in these rows, each with what stands where the row is -1."""
    table = np.empty((len(columns), len(columns[0][0]) + 1), dtype=columns[0][0].dtype)
    for line, (values, missing) in zip(table, columns, strict=True):
        line[:-1] = values
        line[-1] = missing  # row -1 is the last one
    return table.take(row, axis=1)
