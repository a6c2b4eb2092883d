"""What is still to be done: the difference between what a campaign asks for and what the manifest has.

Idea     every family of files is cut into shards of `realisations_per_file`, aligned at 0. A shard is done when one
         file covers it. What is missing is cut into orders of at most `block` fields, small enough to keep all workers
         busy; the parts they leave are packed into the shard's one file, so the files do not depend on how the work was
         scheduled.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

from survey_mc.campaign import Campaign, Cell
from survey_mc.run.order import Order
from survey_mc.store import Family, Manifest, Record
from survey_mc.store.layout import StoredTable

# Realisations that are left alone, by the field key (drawing) or the detect key (a method): see `gaps`.
LeftAlone = Mapping[str, Collection[int]]
NOTHING_LEFT_ALONE: LeftAlone = MappingProxyType({})
Range = tuple[int, int]


def shards(n_realisations: int, per_file: int) -> Iterator[Range]:
    """Ranges of realisations of the stored files of one family."""
    for start in range(0, n_realisations, per_file):
        yield start, min(start + per_file, n_realisations)


def missing_ranges(records: Iterable[Record], start: int, stop: int, except_for: Collection[int] = ()) -> list[Range]:
    """Parts of start … stop − 1 that no file covers, without the realisations in `except_for`."""
    holes: list[Range] = []
    here = start
    for begin, end in sorted((r.piece.start, r.piece.stop) for r in records):
        if here < min(begin, stop):
            holes.append((here, min(begin, stop)))
        here = max(here, end)
    if here < stop:
        holes.append((here, stop))
    for number in sorted(except_for):
        holes = [part for a, b in holes for part in _without(a, b, number)]
    return holes


def _without(start: int, stop: int, number: int) -> list[Range]:
    if not start <= number < stop:
        return [(start, stop)]
    return [part for part in ((start, number), (number + 1, stop)) if part[0] < part[1]]


def families_of(cell: Cell) -> Iterator[Family]:
    """All families of files of a cell."""
    yield Family("truth", cell.field_key)
    for method in cell.methods:
        yield Family("detections", method.detect_key)
        yield Family("matches", method.match_key)
        yield Family("links", method.match_key)


@dataclass(frozen=True, slots=True)
class Missing:
    """What lacks in one shard of a cell: ranges for the truth, and for detections and matches by method label."""

    truth: list[Range]
    detect: dict[str, list[Range]]
    match: dict[str, list[Range]]

    def breaks(self) -> list[int]:
        every = [self.truth, *self.detect.values(), *self.match.values()]
        return sorted({place for ranges in every for part in ranges for place in part})


def _missing_in(manifest: Manifest, cell: Cell, start: int, stop: int, failed: LeftAlone) -> Missing:
    undrawn = [j for j in range(start, stop) if j in failed.get(cell.field_key, ())]

    def holes(table: StoredTable, key: str, broken: list[int]) -> list[Range]:
        return missing_ranges(manifest.covering(Family(table, key), start, stop), start, stop, broken)

    detect: dict[str, list[Range]] = {}
    match: dict[str, list[Range]] = {}
    # Methods that differ in nothing but their labels have the same files: the first of them makes these.
    for method in {method.match_key: method for method in reversed(cell.methods)}.values():
        broken = [j for j in range(start, stop) if j in undrawn or j in failed.get(method.detect_key, ())]
        detect[method.label] = holes("detections", method.detect_key, broken)
        match[method.label] = [
            *holes("matches", method.match_key, broken),
            *holes("links", method.match_key, broken),
        ]
    return Missing(holes("truth", cell.field_key, undrawn), detect, match)


def orders(
    campaign: Campaign,
    cells: Iterable[Cell],
    manifest: Manifest,
    root: Path,
    block: int | Callable[[int], int],
    failed: LeftAlone = NOTHING_LEFT_ALONE,
) -> Iterator[Order]:
    """Orders for all that is missing, cell by cell.

    block: the most fields in each, a number or a function of the cell's index that is asked for every order anew.
    """
    for cell in cells:
        for start, stop in shards(cell.realisations, campaign.store.realisations_per_file):
            lacking = _missing_in(manifest, cell, start, stop, failed)
            places = lacking.breaks()
            for a, b in pairwise(places):
                truth = _inside(a, lacking.truth)
                detect = tuple(label for label, ranges in lacking.detect.items() if _inside(a, ranges))
                match = tuple(label for label, ranges in lacking.match.items() if _inside(a, ranges))
                if not (truth or detect or match):
                    continue
                only_match = [m for m in cell.methods if m.label in match and m.label not in detect]
                first = a
                while first < b:
                    last = min(first + (block if isinstance(block, int) else block(cell.index)), b)
                    stored = {
                        m.label: tuple(manifest.covering(Family("detections", m.detect_key), first, last))
                        for m in only_match
                    }
                    yield Order(campaign, root, cell.index, first, last, truth, detect, match, stored)
                    first = last


def _inside(place: int, ranges: Iterable[Range]) -> bool:
    return any(a <= place < b for a, b in ranges)
