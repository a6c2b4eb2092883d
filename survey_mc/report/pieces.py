"""Matches beside their detections, piece by piece.

Idea     both tables stream in order of realisation; detections are held only as long as matches may still ask for
         them. A row of matches finds its detection by (realisation, det_id).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

DET_ID_BITS = 32


@dataclass(frozen=True, slots=True)
class Joined:
    """Rows of matches and, for each, the row of its detection (−1: none)."""

    matches: DataFrame
    detections: DataFrame
    row: NDArray[np.int64]

    def of_detection(self, column: str) -> FloatArray:
        """(n,) the detections' column for each row of the matches; NaN where there is none."""
        values = np.full(len(self.row), np.nan)
        if column in self.detections:
            known = self.row >= 0
            values[known] = self.detections[column].to_numpy(np.float64)[self.row[known]]
        return values

    def where(self, keep: NDArray[np.bool_]) -> Joined:
        """Some of the rows."""
        return Joined(self.matches[keep], self.detections, self.row[keep])


def joined_pieces(matches: Iterator[DataFrame], detections: Iterator[DataFrame]) -> Iterator[Joined]:
    """Each piece of the matches with the detections of its realisations, however these are cut into pieces."""
    import pandas as pd

    held = pd.DataFrame({"realisation": np.empty(0, np.int32), "det_id": np.empty(0, np.int32)})
    for piece in matches:
        last = int(piece["realisation"].max()) if len(piece) else -1
        while not len(held) or int(held["realisation"].iloc[-1]) < last:
            more = next(detections, None)
            if more is None:
                break
            held = pd.concat([held, more], ignore_index=True) if len(held) else more
        yield Joined(piece, held, _rows(piece, held))
        held = held[held["realisation"] > last].reset_index(drop=True)


def _key(frame: DataFrame) -> NDArray[np.int64]:
    realisation, det_id = (frame[name].to_numpy(np.int64) for name in ("realisation", "det_id"))
    key: NDArray[np.int64] = (realisation << DET_ID_BITS) + det_id
    return key


def _rows(matches: DataFrame, detections: DataFrame) -> NDArray[np.int64]:
    wanted, known = _key(matches), _key(detections)
    if not len(known):
        return np.full(len(wanted), -1, dtype=np.int64)
    order = np.argsort(known, kind="stable")
    place = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(known) - 1)]
    is_there = (known[place] == wanted) & (matches["det_id"].to_numpy(np.int64) >= 0)
    return np.where(is_there, place, -1)
