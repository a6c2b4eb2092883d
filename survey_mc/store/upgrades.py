"""From the tables of older versions to the present ones.

Idea     each change of a stored table is one step: a function from rows as they were to rows as they are one version
         later. Readers apply what a file's schema version lacks, so every store ever written opens; `migrate` writes
         the outcome down. To change a table: raise its `version` in `columns`, add the step here, and keep a small
         store of the version before among the fixtures of the tests.
Limits   a step sees the rows of one file and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from survey_mc.columns import DETECTIONS, LINKS, MATCHES, TRUTH, Column, Table
from survey_mc.errors import BadInput
from survey_mc.store.layout import StoredTable

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True)
class Step:
    """table: which one. from_version: of the rows that `change` takes; it gives those of the next. about: one sentence.

    change: adds, renames, converts or drops columns of the declared table; a method's own columns it leaves alone. What
    it does not convert is converted to the declared types afterwards, where no value is lost by it.
    """

    table: StoredTable
    from_version: int
    about: str
    change: Callable[[DataFrame], DataFrame]


PRESENT: dict[StoredTable, Table] = {"truth": TRUTH, "detections": DETECTIONS, "matches": MATCHES, "links": LINKS}
# No stored table has changed since the first version.
STEPS: tuple[Step, ...] = ()


def is_present(table: StoredTable, version: int, where: str) -> bool:
    """Whether rows of that version are those of today; `BadInput` for those of a later one. where: the file."""
    present = PRESENT[table].version
    if version > present:
        raise BadInput(
            where, f"table {table!r} has version {version}, this survey_mc reads {present}; install a newer survey_mc"
        )
    return version == present


def upgraded(table: StoredTable, version: int, rows: DataFrame, where: str) -> DataFrame:
    """Rows of an older version as today's, declared columns first; their types are those the steps gave them."""
    for number in range(version, PRESENT[table].version):
        step = next((s for s in STEPS if (s.table, s.from_version) == (table, number)), None)
        if step is None:
            raise BadInput(where, f"table {table!r} has version {version}, and no way leads from {number} to the next")
        rows = step.change(rows)
    names = PRESENT[table].names
    lacking = [name for name in names if name not in rows.columns]
    if lacking:
        raise BadInput(where, f"table {table!r} of version {version} has no columns {', '.join(lacking)}")
    return rows[[*names, *(name for name in rows.columns if name not in names)]]


def present_table(table: StoredTable, stored: tuple[Column, ...], rows: DataFrame) -> Table:
    """The declared table that upgraded rows belong to: today's columns, and a method's own as they were stored."""
    declared = PRESENT[table]
    own = tuple(c for c in stored if c.name in rows.columns and c.name not in declared.names)
    return declared.with_columns(own)
