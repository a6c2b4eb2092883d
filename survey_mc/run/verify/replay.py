"""Random stored fields, computed again from the run directory alone and compared to the last bit.

Idea     fields are numbered without being listed: cell by cell, method by method, file by file; a number is found by
         bisection.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterator
from itertools import accumulate
from typing import TYPE_CHECKING

from survey_mc.campaign import Campaign, Cell, CellMethod, expand
from survey_mc.errors import SurveyError
from survey_mc.rng import stream
from survey_mc.run.simulate import replay
from survey_mc.run.stages import stack, stored_truth, table_of
from survey_mc.store import Family, Manifest, Piece, RunLayout, read_piece
from survey_mc.store.layout import StoredTable

if TYPE_CHECKING:
    from pandas import DataFrame


class StoredFields:
    """The stored (cell, method, realisation) of a campaign, by number."""

    def __init__(self, campaign: Campaign, manifest: Manifest) -> None:
        self.places: list[tuple[Cell, CellMethod]] = []
        self.ranges: list[list[tuple[int, int]]] = []
        for cell in expand(campaign):
            for method in cell.methods:
                records = manifest.records(Family("matches", method.match_key))
                found = [(r.piece.start, min(r.piece.stop, cell.realisations)) for r in records]
                self.places.append((cell, method))
                self.ranges.append([(start, stop) for start, stop in found if start < stop])
        self.ends = list(accumulate(sum(stop - start for start, stop in ranges) for ranges in self.ranges))

    def __len__(self) -> int:
        return self.ends[-1] if self.ends else 0

    def __getitem__(self, number: int) -> tuple[Cell, CellMethod, int]:
        place = bisect_right(self.ends, number)
        left = number - (self.ends[place - 1] if place else 0)
        for start, stop in self.ranges[place]:
            if left < stop - start:
                return *self.places[place], start + left
            left -= stop - start
        raise IndexError(number)


def sample(campaign: Campaign, manifest: Manifest, n_fields: int, seed: int) -> Iterator[tuple[Cell, CellMethod, int]]:
    """Random stored fields, none twice; all of them if there are no more."""
    stored = StoredFields(campaign, manifest)
    if len(stored):
        rng = stream(f"{campaign.seed}/{seed}", "replay")
        for number in rng.choice(len(stored), size=min(n_fields, len(stored)), replace=False):
            yield stored[int(number)]


def differences(
    campaign: Campaign,
    field: tuple[Cell, CellMethod, int],
    layout: RunLayout,
    manifest: Manifest,
    damaged: Collection[Piece],
) -> Iterator[str]:
    """Sentences about what of a field is stored otherwise than it is computed now; damaged files are passed over."""
    cell, method, realisation = field
    where = f"{cell.label} / {method.label} / realisation {realisation}"
    try:
        again = replay(campaign, cell, method.label, realisation)
    except Exception as problem:
        yield f"{where}: cannot be computed again: {type(problem).__name__}: {problem}"
        return
    fresh: dict[StoredTable, tuple[str, DataFrame]] = {
        "truth": (cell.field_key, stored_truth(again.field).frame()),
        "detections": (method.detect_key, again.detections),
        "matches": (method.match_key, again.matched.matches),
        "links": (method.match_key, again.matched.links),
    }
    for table, (key, frame) in fresh.items():
        records = manifest.covering(Family(table, key), realisation, realisation + 1)
        if not records or records[0].piece in damaged:
            continue
        try:
            kept = read_piece(layout, records[0])
        except SurveyError as problem:
            yield f"{where}: {table}: {problem}"
            continue
        kept = kept[kept["realisation"] == realisation].reset_index(drop=True)
        if not _same(kept, stack([(realisation, frame)], table_of(table, method.name)).frame()):
            yield f"{where}: {table}: computed again gives other rows than the stored ones"


def _same(kept: DataFrame, fresh: DataFrame) -> bool:
    """Equal to the last bit, NaN equal to NaN."""
    if list(kept.columns) != list(fresh.columns) or len(kept) != len(fresh):
        return False
    return all(kept[name].astype(object).equals(fresh[name].astype(object)) for name in kept.columns)
