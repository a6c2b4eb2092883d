"""Tables put together from parts: the rows of one cell, method, rule and kind, and what is the same for all of them.

Idea     the common columns are written down once a part and spread over its rows when the table is made; putting them
         into every part cost half the time of a report of few fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.columns import Column, Table

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True)
class Part:
    """Rows of a table, and columns that they lack: (n,) values or the one value that all rows have."""

    rows: DataFrame
    common: Mapping[str, Any]

    def having(self, **common: Any) -> Part:
        """The same rows with more columns."""
        return replace(self, common={**self.common, **common})

    def column(self, column: Column) -> NDArray[Any]:
        """(n,) a declared column."""
        dtype = np.dtype(object if column.dtype == "string" else column.dtype)
        if column.name in self.common:
            value = self.common[column.name]
            return np.full(len(self.rows), value, dtype) if np.ndim(value) == 0 else np.asarray(value, dtype)
        return np.asarray(self.rows[column.name].to_numpy(dtype))


Parts = Mapping[str, list[Part]]  # by table


def declared(table: Table, parts: Iterable[Part]) -> DataFrame:
    """The rows of all parts with exactly the declared columns and types."""
    import pandas as pd

    occupied = [part for part in parts if len(part.rows)]
    columns = {}
    for c in table.columns:
        dtype = "object" if c.dtype == "string" else c.dtype
        values = np.concatenate([part.column(c) for part in occupied]) if occupied else None
        columns[c.name] = pd.Series(values, dtype=dtype)
    return pd.DataFrame(columns)
