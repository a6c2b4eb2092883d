"""Matches beside their detections, piece by piece.

Idea     both tables stream in order of realisation; detections are held only as long as matches may still ask for
         them. A row of matches finds its detection by (realisation, det_id).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.match_rows import MatchRows
from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

DET_ID_BITS = 32
NUMBERING = ("realisation", "det_id")

Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Joined:
    """Rows of matches and, for each, the row of its detection (−1: none)."""

    matches: MatchRows
    detections: Columns
    row: NDArray[np.int64]

    def of_detection(self, column: str) -> FloatArray:
        """(n,) the detections' column for each row of the matches; NaN where there is none."""
        values = np.full(len(self.row), np.nan)
        if column in self.detections:
            known = self.row >= 0
            values[known] = self.detections[column][self.row[known]]
        return values

    def where(self, keep: BoolArray) -> Joined:
        """Some of the rows."""
        return Joined(self.matches.where(keep), self.detections, self.row[keep])


def joined_pieces(matches: Iterator[DataFrame], detections: Iterator[DataFrame]) -> Iterator[Joined]:
    """Each piece of the matches with the detections of its realisations, however these are cut into pieces."""
    held: Columns = {name: np.empty(0, np.int32) for name in NUMBERING}
    for piece in matches:
        rows = MatchRows.of(piece)
        last = int(rows.integers("realisation").max()) if len(rows) else -1
        while not len(held["realisation"]) or int(held["realisation"][-1]) < last:
            more = next(detections, None)
            if more is None:
                break
            held = _appended(held, {name: more[name].to_numpy() for name in more.columns})
        yield Joined(rows, held, _detection_rows(rows, held))
        later = held["realisation"] > last
        held = held if later.all() else {name: values[later] for name, values in held.items()}


def _appended(held: Columns, more: Columns) -> Columns:
    if not len(held["realisation"]):
        return more
    return {name: np.concatenate((held[name], more[name])) for name in more}


def _key(realisation: NDArray[np.integer[Any]], det_id: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
    key: NDArray[np.int64] = (realisation.astype(np.int64) << DET_ID_BITS) + det_id
    return key


def _detection_rows(matches: MatchRows, detections: Columns) -> NDArray[np.int64]:
    det_id = matches.integers("det_id")
    wanted, known = _key(matches.integers("realisation"), det_id), _key(*(detections[name] for name in NUMBERING))
    if not len(known):
        return np.full(len(wanted), -1, dtype=np.int64)
    order = np.argsort(known, kind="stable")
    place = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(known) - 1)]
    is_there = (known[place] == wanted) & (det_id >= 0)
    return np.where(is_there, place, -1)
