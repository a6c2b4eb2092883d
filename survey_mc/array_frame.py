"""Rows of a table as plain arrays: what flows from stage to stage.

Idea     one array a column. Drawing, matching and storing a field take a few milliseconds together, and making or
         reading one pandas frame half of one; so a frame is made where somebody looks at the rows, not in between.
Limits   columns are numbers, truth values or texts that repeat; a missing number is NaN, a text is never missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pandas import DataFrame


# A frame with numbers of these types alone can be read in one piece without losing a bit.
_EXACT_AS_FLOAT64 = frozenset(map(np.dtype, ("bool", "int8", "int16", "int32", "uint8", "uint16", "uint32", "float64")))


def arrays_of(frame: DataFrame) -> dict[str, NDArray[Any]]:
    """The columns of a frame as arrays; one by one they cost pandas 30 µs each."""
    dtypes = frame.dtypes.tolist()
    if not _EXACT_AS_FLOAT64.issuperset(dtypes):
        return {str(name): column.to_numpy() for name, column in frame.items()}
    table = np.ascontiguousarray(frame.to_numpy(np.float64).T)
    names = frame.columns.tolist()
    return {name: values.astype(dtype, copy=False) for name, values, dtype in zip(names, table, dtypes, strict=True)}


@dataclass(frozen=True, slots=True)
class Texts:
    """A column of texts: row i holds words[code[i]]. words: distinct. code: (n,) int32."""

    words: tuple[str, ...]
    code: NDArray[np.int32]

    @classmethod
    def of(cls, texts: Sequence[str]) -> Texts:
        """Texts one by one."""
        place = {word: number for number, word in enumerate(dict.fromkeys(texts))}
        return cls(tuple(place), np.array([place[text] for text in texts], dtype=np.int32))

    @classmethod
    def repeated(cls, word: str, n: int) -> Texts:
        """The same text n times."""
        return cls((word,), np.zeros(n, dtype=np.int32))

    def __len__(self) -> int:
        return len(self.code)

    def are(self, word: str) -> NDArray[np.bool_]:
        """(n,) where the text is this word."""
        return np.equal(self.code, self.words.index(word) if word in self.words else -1)

    def take(self, row: NDArray[np.integer[Any]], missing: str = "") -> Texts:
        """The texts of these rows; `missing` where the row is -1."""
        words = (*self.words, missing) if missing not in self.words else self.words
        codes = np.append(self.code, np.int32(words.index(missing)))  # row -1 is the last one
        return Texts(words, codes[row])

    def arrow(self) -> Any:
        """The column as an Arrow array of strings."""
        import pyarrow as pa

        return pa.array(self.words, pa.string()).take(pa.array(self.code))


@dataclass(frozen=True, slots=True)
class ArrayFrame:
    """Columns of equal length by name, read-only.

    rows[name] are the numbers of a column, `texts(name)` those of a column of texts.
    """

    columns: Mapping[str, NDArray[Any] | Texts]

    def __post_init__(self) -> None:
        for column in self.columns.values():
            (column.code if isinstance(column, Texts) else column).setflags(write=False)

    @classmethod
    def of_frame(cls, frame: DataFrame) -> ArrayFrame:
        """The rows of a frame whose columns have numbers or texts."""
        arrays = arrays_of(frame).items()
        return cls({n: a if a.dtype.kind in "biuf" else Texts.of([str(text) for text in a]) for n, a in arrays})

    @classmethod
    def together(cls, parts: Sequence[ArrayFrame]) -> ArrayFrame:
        """The rows of several tables with the same columns, one after the other; of each column the first's type."""
        if len(parts) == 1:
            return parts[0]
        return cls({name: _joined([part.columns[name] for part in parts]) for name in parts[0].columns})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, name: str) -> NDArray[Any]:
        column = self.columns[name]
        if isinstance(column, Texts):
            raise KeyError(f"{name} holds texts")
        return column

    def texts(self, name: str) -> Texts:
        """A column of texts."""
        column = self.columns[name]
        if not isinstance(column, Texts):
            raise KeyError(f"{name} holds numbers")
        return column

    def where(self, keep: NDArray[np.bool_]) -> ArrayFrame:
        """The rows for which `keep` (n,) is true."""
        row = np.flatnonzero(keep)
        return ArrayFrame(
            {
                name: Texts(column.words, column.code[row]) if isinstance(column, Texts) else column[row]
                for name, column in self.columns.items()
            }
        )

    def frame(self) -> DataFrame:
        """The rows as a frame of their own: it may be written to."""
        import pandas as pd

        def pandas_column(column: NDArray[Any] | Texts) -> Any:
            if not isinstance(column, Texts):
                return column
            words = pd.Series([*column.words, ""]).array  # of the text type of the installed pandas, even without words
            return words.take(column.code)

        return pd.DataFrame({name: pandas_column(column) for name, column in self.columns.items()})


def _joined(parts: Sequence[NDArray[Any] | Texts]) -> NDArray[Any] | Texts:
    texts = [part for part in parts if isinstance(part, Texts)]
    if not texts:
        return np.concatenate(parts, dtype=parts[0].dtype)  # type: ignore[arg-type, union-attr]
    words = tuple(dict.fromkeys(word for part in texts for word in part.words))
    place = {word: number for number, word in enumerate(words)}
    codes = [np.array([place[word] for word in part.words], dtype=np.int32)[part.code] for part in texts]
    return Texts(words, np.concatenate(codes))
