"""A run as data frames: what most users need of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.errors import BadInput
from survey_mc.run.stages import table_of
from survey_mc.store import RunData
from survey_mc.store.layout import StoredTable
from survey_mc.store.parquet import empty_frame, read_frame

if TYPE_CHECKING:
    from pandas import DataFrame


class Run:
    """An opened run directory.

    Every frame has the columns `cell` and, where it applies, `method` in front; `columns` of the package says what the
    others mean. cell, method: labels to restrict to (default all). For runs too large for memory use `data.frames`.
    """

    def __init__(self, run_dir: Path | str) -> None:
        self.data = RunData(run_dir)

    @property
    def cells(self) -> tuple[str, ...]:
        """Labels of the cells."""
        return tuple(cell.label for cell in self.data.cells)

    @property
    def methods(self) -> tuple[str, ...]:
        """Labels of the methods."""
        return tuple(method.label for method in self.data.methods)

    def truth(self, cell: str | None = None) -> DataFrame:
        """True sources (`columns.TRUTH`)."""
        return self._gather("truth", cell, ("",))

    def detections(self, method: str | None = None, cell: str | None = None) -> DataFrame:
        """Detections: `columns.DETECTIONS`, the methods' own columns, and those that the original programs name
        otherwise under their names (DET_ML, NET_COUNTS …); NaN where a method has no such column."""
        return self._gather("detections", cell, self._methods(method))

    def matches(self, method: str | None = None, cell: str | None = None, rule: str | None = None) -> DataFrame:
        """Matches (`columns.MATCHES`); rule: nearest or origin, default both."""
        frame = self._gather("matches", cell, self._methods(method))
        if rule is None:
            return frame
        known = ("nearest", "origin")
        if rule not in known:
            raise BadInput("rule", f"must be one of {', '.join(known)} (got {rule!r})")
        return frame[frame["rule"] == rule].reset_index(drop=True)

    def links(self, method: str | None = None, cell: str | None = None) -> DataFrame:
        """Candidate pairs (`columns.LINKS`)."""
        return self._gather("links", cell, self._methods(method))

    def journal(self) -> DataFrame:
        """What each task cost (see `RunData.journal`)."""
        return self.data.journal()

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the aggregated tables that `survey-mc report` has made."""
        folders = (self.data.layout.tables, self.data.layout.journals)
        return tuple(sorted(path.stem for folder in folders for path in folder.glob("*.parquet")))

    def table(self, name: str) -> DataFrame:
        """An aggregated table, such as "completeness"."""
        if name not in self.tables:
            known = ", ".join(self.tables) or "none yet; run `survey-mc report`"
            raise BadInput(str(self.data.layout.root), f"has no table {name!r}; known: {known}")
        folder = self.data.layout.tables
        path = folder / f"{name}.parquet"
        return read_frame(path if path.exists() else self.data.layout.journals / path.name)

    def _methods(self, method: str | None) -> tuple[str, ...]:
        return self.methods if method is None else (method,)

    def _gather(self, table: StoredTable, cell: str | None, methods: tuple[str, ...]) -> DataFrame:
        import pandas as pd

        from survey_mc.detect import DETECTORS, with_native_names

        names = {record.label: record.name for record in self.data.methods}
        cells = self.cells if cell is None else (cell,)

        def labelled(stored: Callable[[str, str], Iterable[DataFrame]]) -> Iterator[DataFrame]:
            for cell_label in cells:
                for method in methods:
                    for rows in stored(cell_label, method):
                        frame = rows
                        if table == "detections":
                            frame = with_native_names(DETECTORS[names[method]], frame)
                        if method:
                            frame.insert(0, "method", method)
                        frame.insert(0, "cell", cell_label)
                        yield frame

        frames = list(labelled(partial(self.data.frames, table)))
        # Where nothing is stored, the declared columns with their types.
        nothing = labelled(lambda _, method: [empty_frame(table_of(table, names.get(method, "")))])
        return pd.concat(frames or list(nothing), ignore_index=True)


def open_run(run_dir: Path | str) -> Run:
    """Open a run directory for analysis; raises `BadInput` if it is none."""
    return Run(run_dir)
