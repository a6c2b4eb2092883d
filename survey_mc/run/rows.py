"""Rows of an order: those that are ready to be stored, and those that are in the store already."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol

from survey_mc.campaign import CellMethod
from survey_mc.columns import Table
from survey_mc.run.stages import stack, table_of
from survey_mc.store import Family, Piece, Record, RunLayout, commit_piece, read_piece
from survey_mc.store.layout import StoredTable

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.array_frame import ArrayFrame


class Timed(Protocol):
    """Books the time of a block on a method and a stage."""

    def __call__(self, method: str, stage: str, fields: int = 1) -> AbstractContextManager[None]: ...


class Rows:
    """Rows that are ready to be stored, by family, in order of realisation."""

    def __init__(self) -> None:
        self.rows: dict[Family, list[tuple[int, ArrayFrame]]] = {}
        self.tables: dict[Family, Table] = {}
        self.methods: dict[Family, str] = {}

    def keep(self, name: StoredTable, key: str, method: CellMethod | None, realisation: int, rows: ArrayFrame) -> None:
        family = Family(name, key)
        if family not in self.rows:
            self.rows[family] = []
            self.tables[family] = table_of(name, method.name if method else "")
            self.methods[family] = method.label if method else ""
        self.rows[family].append((realisation, rows))

    def commit(self, layout: RunLayout, timed: Timed) -> Iterator[Record]:
        for family, rows in self.rows.items():
            table = self.tables[family]
            for run in _contiguous(rows):
                with timed(self.methods[family], "commit", len(run)):
                    yield commit_piece(layout, Piece(family, run[0][0], run[-1][0] + 1), table, stack(run, table))


class StoredRows:
    """Detections that are already in the store, by realisation."""

    def __init__(self, layout: RunLayout, records: tuple[Record, ...]) -> None:
        self.layout, self.records = layout, records
        self.frames: dict[Piece, DataFrame] = {}

    def of(self, realisation: int) -> DataFrame:
        record = next(r for r in self.records if r.piece.start <= realisation < r.piece.stop)
        if record.piece not in self.frames:
            self.frames[record.piece] = read_piece(self.layout, record)
        frame = self.frames[record.piece]
        return frame[frame["realisation"] == realisation].drop(columns="realisation").reset_index(drop=True)


def _contiguous(rows: list[tuple[int, ArrayFrame]]) -> Iterator[list[tuple[int, ArrayFrame]]]:
    """Runs of consecutive realisations: a failed field leaves a gap between two files."""
    run: list[tuple[int, ArrayFrame]] = []
    for row in rows:
        if run and row[0] != run[-1][0] + 1:
            yield run
            run = []
        run.append(row)
    if run:
        yield run
