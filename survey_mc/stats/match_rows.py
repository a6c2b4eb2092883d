"""Rows of matches as plain arrays.

Idea     a column is taken out of its frame when it is first asked for, and a subset takes its columns from the rows it
         is a subset of: what nobody asks for is never cut. Texts become small numbers with their names beside them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

Texts = tuple[NDArray[np.int64], tuple[str, ...]]


class MatchRows:
    """Some rows of `columns.MATCHES`; to be made of a frame by `MatchRows.of`."""

    __slots__ = ("_columns", "_cut", "_cut_texts", "_size", "_texts")

    def __init__(self, size: int, cut: Callable[[str], NDArray[Any]], cut_texts: Callable[[str], Texts]) -> None:
        self._size, self._cut, self._cut_texts = size, cut, cut_texts
        self._columns: dict[str, NDArray[Any]] = {}
        self._texts: dict[str, Texts] = {}

    @classmethod
    def of(cls, matches: DataFrame | MatchRows) -> MatchRows:
        """The rows of a frame; rows already taken out of one stay as they are."""
        if isinstance(matches, MatchRows):
            return matches
        frame = matches

        def cut_texts(name: str) -> Texts:
            import pandas as pd

            places, names = pd.factorize(frame[name])
            return places, tuple(str(text) for text in names)

        return cls(len(frame), lambda name: frame[name].to_numpy(), cut_texts)

    def __len__(self) -> int:
        return self._size

    def numbers(self, name: str) -> FloatArray:
        """(n,) a column of numbers."""
        return np.asarray(self._column(name), dtype=np.float64)

    def integers(self, name: str) -> NDArray[np.int64]:
        """(n,) a column of whole numbers."""
        return np.asarray(self._column(name), dtype=np.int64)

    def texts(self, name: str) -> Texts:
        """(n,) places of a column's texts in the names that follow; −1: none."""
        if name not in self._texts:
            self._texts[name] = self._cut_texts(name)
        return self._texts[name]

    def has(self, name: str, *values: str) -> BoolArray:
        """(n,) whether a column of texts is one of some values."""
        places, names = self.texts(name)
        return np.array([*(text in values for text in names), False])[places]  # −1 takes the last one

    def where(self, keep: BoolArray) -> MatchRows:
        """Some of the rows."""
        if keep.all():
            return self
        rows = np.flatnonzero(keep)

        def cut_texts(name: str) -> Texts:
            places, names = self.texts(name)
            return places[rows], names

        return MatchRows(len(rows), lambda name: self._column(name)[rows], cut_texts)

    def _column(self, name: str) -> NDArray[Any]:
        if name not in self._columns:
            self._columns[name] = self._cut(name)
        return self._columns[name]
