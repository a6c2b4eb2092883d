"""What is still to be done: the difference between what a campaign asks for and what the manifest has.

Idea     every family of files is cut into shards of `realisations_per_file`, aligned at 0. A shard is done when one
         file covers it. What is missing is cut into orders of at most `block` fields, small enough to keep all workers
         busy; the parts they leave are packed into the shard's one file, so the files do not depend on how the work was
         scheduled.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

from survey_mc.campaign import Campaign, Cell, CellMethod
from survey_mc.run.task import Order
from survey_mc.store import Family, Manifest, Record

# Realisations that failed before, by the field key (drawing) or the detect key (a method); they are left alone unless
# asked for again.
KnownFailures = Mapping[str, Collection[int]]
NO_FAILURES: KnownFailures = MappingProxyType({})
Range = tuple[int, int]

ORDERS_PER_WORKER = 8  # enough to even out unequal fields, few enough to keep the overhead of an order small


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


def families_of(cell: Cell) -> Iterator[tuple[Family, CellMethod | None]]:
    """All families of files of a cell."""
    yield Family("truth", cell.field_key), None
    for method in cell.methods:
        yield Family("detections", method.detect_key), method
        yield Family("matches", method.match_key), method
        yield Family("links", method.match_key), method


@dataclass(frozen=True, slots=True)
class Missing:
    """What lacks in one shard of a cell: ranges for the truth, and for detections and matches by method label."""

    truth: list[Range]
    detect: dict[str, list[Range]]
    match: dict[str, list[Range]]

    def breaks(self) -> list[int]:
        every = [self.truth, *self.detect.values(), *self.match.values()]
        return sorted({place for ranges in every for part in ranges for place in part})


def _missing_in(manifest: Manifest, cell: Cell, start: int, stop: int, failed: KnownFailures) -> Missing:
    undrawn = [j for j in range(start, stop) if j in failed.get(cell.field_key, ())]
    truth = missing_ranges(manifest.covering(Family("truth", cell.field_key), start, stop), start, stop, undrawn)
    detect: dict[str, list[Range]] = {}
    match: dict[str, list[Range]] = {}
    for method in cell.methods:
        broken = [j for j in range(start, stop) if j in undrawn or j in failed.get(method.detect_key, ())]
        for wanted, tables in ((detect, ("detections",)), (match, ("matches", "links"))):
            key = method.detect_key if wanted is detect else method.match_key
            holes = [
                hole
                for table in tables
                for hole in missing_ranges(manifest.covering(Family(table, key), start, stop), start, stop, broken)  # type: ignore[arg-type]
            ]
            wanted[method.label] = holes
    return Missing(truth, detect, match)


def orders(
    campaign: Campaign,
    cells: Iterable[Cell],
    manifest: Manifest,
    root: Path,
    block: int,
    failed: KnownFailures = NO_FAILURES,
) -> Iterator[Order]:
    """Orders for all that is missing, cell by cell, at most `block` fields each."""
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
                for first in range(a, b, block):
                    last = min(first + block, b)
                    stored = {
                        m.label: tuple(manifest.covering(Family("detections", m.detect_key), first, last))
                        for m in only_match
                    }
                    yield Order(campaign, root, cell.index, first, last, truth, detect, match, stored)


def _inside(place: int, ranges: Iterable[Range]) -> bool:
    return any(a <= place < b for a, b in ranges)


def block_size(n_fields: int, workers: int, per_file: int) -> int:
    """Fields in one order: a whole file where there is much to do, fewer where workers would otherwise wait."""
    return max(1, min(per_file, n_fields // (ORDERS_PER_WORKER * max(workers, 1))))
