"""Reading a run: which cells and methods it has, and their rows, piece by piece.

Idea     the lock file says what belongs to the campaign, the manifest says what is there; nothing is globbed. Pieces
         stream in order of realisation, so a reader's memory does not grow with their number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from survey_mc.errors import BadInput, DamagedStore
from survey_mc.registry import UnknownName
from survey_mc.store.journal_lines import read_lines
from survey_mc.store.layout import Family, RunLayout, StoredTable
from survey_mc.store.lock_file import REMEDY as LOCK_REMEDY
from survey_mc.store.lock_file import read_lock
from survey_mc.store.manifest import REMEDY, Manifest
from survey_mc.store.stored_rows import read_piece

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True)
class MethodRecord:
    """A method of a campaign: the registered procedure `name` under the campaign's own `label`."""

    name: str
    label: str


@dataclass(frozen=True, slots=True)
class CellRecord:
    """One combination of the grid, with the numbers a table needs and the keys of its stages.

    counts_min: count limit of the input list. region_arcmin: radius of the analysed region; region_deg2: observed
    area in it. detect_keys, match_keys: content keys by method label.
    """

    label: str
    instrument: str
    band: str
    exposure_ks: float
    realisations: int
    counts_min: float
    region_arcmin: float
    region_deg2: float
    radius_arcsec: float
    rule: str
    flux_per_rate_cgs: float
    field_key: str
    detect_keys: dict[str, str]
    match_keys: dict[str, str]

    def family(self, table: StoredTable, method_label: str) -> Family:
        """The stored family of a table of this cell."""
        if table == "truth":
            return Family(table, self.field_key)
        keys = self.detect_keys if table == "detections" else self.match_keys
        if method_label not in keys:
            raise UnknownName("method", method_label, keys)
        return Family(table, keys[method_label])


class RunData:
    """A run directory opened for reading.

    `cells` and `methods` list what the campaign asks for; `frames` streams what is stored of it.
    """

    def __init__(self, run_dir: Path | str) -> None:
        self.layout = RunLayout(Path(run_dir))
        self.lock: dict[str, Any] = read_lock(self.layout.lock_file)
        self.manifest = Manifest(self.layout.manifest)
        if self.manifest.damaged_lines:
            number, why = next(iter(self.manifest.damaged_lines.items()))
            raise DamagedStore(f"{self.layout.manifest}: line {number} {why}; {REMEDY}")
        try:
            self.cells = tuple(_cell_record(entry) for entry in self.lock["cells"])
            self.methods = tuple(MethodRecord(str(m["name"]), str(m["label"])) for m in self.lock["methods"])
        except (KeyError, TypeError, ValueError):
            where = str(self.layout.lock_file)
            raise BadInput(where, f"is damaged: it lacks what a cell or a method has; {LOCK_REMEDY}") from None

    def frames(
        self, table: StoredTable, cell_label: str, method_label: str = "", columns: Sequence[str] | None = None
    ) -> Iterator[DataFrame]:
        """Stored rows in order of realisation, a frame a file; realisations beyond the campaign's are left out."""
        cell = self.cell(cell_label)
        for record in self.manifest.records(cell.family(table, method_label)):
            if record.piece.start >= cell.realisations:
                continue
            frame = read_piece(self.layout, record, columns)
            if record.piece.stop > cell.realisations:
                frame = frame[frame["realisation"] < cell.realisations].reset_index(drop=True)
            yield frame

    def cell(self, label: str) -> CellRecord:
        """The cell of that label; an unknown one lists the known ones."""
        for cell in self.cells:
            if cell.label == label:
                return cell
        raise UnknownName("cell", label, [c.label for c in self.cells])

    def realisations_done(self, table: StoredTable, cell_label: str, method_label: str = "") -> int:
        """How many realisations of the campaign are stored (a realisation with no rows counts)."""
        cell = self.cell(cell_label)
        return self.manifest.n_realisations(table, cell.family(table, method_label).key, cell.realisations)

    def journal_lines(self) -> Iterator[dict[str, Any]]:
        """Entries of all journals of the run, oldest first; torn and damaged lines are left out."""
        for path in self.layout.journal_files():
            for _, entry in read_lines(path):
                if entry is not None:
                    yield entry

    def journal(self) -> DataFrame:
        """What each task cost: a row for each (task, stage).

        Columns: started (journal name), cell, start, stop, method ("" for drawing), stage (draw, detect, match,
        commit), fields (number of fields worked on), cpu_s and wall_s (sums over these fields).
        """
        import pandas as pd

        rows = [
            {
                "started": entry.get("run", ""),
                "cell": entry["cell"],
                "start": entry["start"],
                "stop": entry["stop"],
                **cost,
            }
            for entry in self.journal_lines()
            if entry.get("event") == "task"
            for cost in entry["costs"]
        ]
        columns = ["started", "cell", "start", "stop", "method", "stage", "fields", "cpu_s", "wall_s"]
        return pd.DataFrame(rows, columns=columns)


def _cell_record(entry: dict[str, Any]) -> CellRecord:
    """The record of a cell in the lock; KeyError, TypeError or ValueError for an entry that is none."""
    makers = {"int": int, "float": float, "str": str}
    fields = CellRecord.__dataclass_fields__
    values: dict[str, Any] = {
        name: makers[field.type](entry[name]) for name, field in fields.items() if field.type in makers
    }
    for name in ("detect_keys", "match_keys"):
        values[name] = {str(label): str(key) for label, key in dict(entry[name]).items()}
    return CellRecord(**values)
