"""The manifest: one line for each file that counts.

Idea     append and fsync; readers trust the manifest and never a directory listing. Only the process that holds the run
         lock appends, so lines never interleave. A torn last line (a crash in the middle of an append) is dropped: its
         file is simply made again, with the same bytes under the same name.
"""

from __future__ import annotations

import json
import os
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from survey_mc.errors import DamagedStore
from survey_mc.store.layout import Family, Piece, StoredTable


@dataclass(frozen=True, slots=True)
class Record:
    """What a committed file is: its piece, SHA-256, rows, bytes and schema version."""

    piece: Piece
    sha256: str
    rows: int
    size_bytes: int
    schema_version: int

    def line(self) -> str:
        content = {
            "path": self.piece.path,
            "sha256": self.sha256,
            "rows": self.rows,
            "bytes": self.size_bytes,
            "schema_version": self.schema_version,
        }
        return json.dumps(content, sort_keys=True) + "\n"


class Manifest:
    """The committed files of a run, by family, in order of realisation."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._families: dict[Family, dict[tuple[int, int], Record]] = {}
        self._in_order: dict[Family, tuple[Record, ...]] = {}
        if path.exists():
            self._read()

    def __iter__(self) -> Iterator[Record]:
        for family in sorted(self._families):
            yield from self.records(family)

    def __len__(self) -> int:
        return sum(len(records) for records in self._families.values())

    def __contains__(self, piece: object) -> bool:
        return isinstance(piece, Piece) and (piece.start, piece.stop) in self._families.get(piece.family, {})

    def records(self, family: Family) -> tuple[Record, ...]:
        """Files of a family, sorted by their first realisation.

        A part that lies inside a larger file is left out: a run that was killed while it packed parts leaves both.
        """
        if family not in self._in_order:
            self._in_order[family] = tuple(record for record, inside in self._nested(family) if not inside)
        return self._in_order[family]

    def covering(self, family: Family, start: int, stop: int) -> tuple[Record, ...]:
        """Files of a family that overlap realisations start … stop − 1, in order."""
        records = self.records(family)
        first = bisect_right(records, start, key=lambda record: record.piece.stop)
        last = bisect_left(records, stop, key=lambda record: record.piece.start)
        return records[first:last]

    def superseded(self) -> tuple[Piece, ...]:
        """Parts that lie inside a larger file and only wait to be dropped."""
        return tuple(r.piece for family in sorted(self._families) for r, inside in self._nested(family) if inside)

    def _nested(self, family: Family) -> Iterator[tuple[Record, bool]]:
        found = self._families.get(family, {})
        reached = 0
        for start, stop in sorted(found, key=lambda place: (place[0], -place[1])):
            yield found[start, stop], stop <= reached
            reached = max(reached, stop)

    def n_realisations(self, table: StoredTable, key: str, below: int) -> int:
        """How many realisations 0 … below − 1 of a family are stored (one with no rows counts)."""
        records = self.records(Family(table, key))
        return sum(max(0, min(r.piece.stop, below) - r.piece.start) for r in records)

    def add(self, records: Iterable[Record]) -> None:
        """Append records of files that are already on disk, durably, in one write."""
        new = list(records)
        if new:
            self._append("".join(record.line() for record in new))
            for record in new:
                self._keep(record)

    def drop(self, pieces: Iterable[Piece]) -> None:
        """Append that these files no longer count (they were packed into a larger one, or are damaged)."""
        gone = list(pieces)
        if gone:
            self._append("".join(json.dumps({"drop": piece.path}) + "\n" for piece in gone))
            for piece in gone:
                self._forget(piece)

    def compact(self) -> None:
        """Rewrite the manifest sorted and without dropped lines: equal stores have equal manifests."""
        content = "".join(record.line() for record in self).encode()
        if self.path.exists() and self.path.read_bytes() == content:
            return
        temporary = self.path.with_suffix(".tmp")
        with temporary.open("wb") as handle:
            handle.write(content)
            handle.flush()
            os.fsync(handle.fileno())
        temporary.replace(self.path)

    def _append(self, text: str) -> None:
        handle = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            size = os.fstat(handle).st_size
            torn = size > 0 and os.pread(handle, 1, size - 1) != b"\n"
            # A torn line of an earlier crash must not swallow the first new one.
            data = (("\n" if torn else "") + text).encode()
            while data:
                data = data[os.write(handle, data) :]
            os.fsync(handle)
        finally:
            os.close(handle)

    def _keep(self, record: Record) -> None:
        self._families.setdefault(record.piece.family, {})[(record.piece.start, record.piece.stop)] = record
        self._in_order.pop(record.piece.family, None)

    def _forget(self, piece: Piece) -> None:
        self._families.get(piece.family, {}).pop((piece.start, piece.stop), None)
        self._in_order.pop(piece.family, None)

    def _read(self) -> None:
        *lines, last = self.path.read_bytes().decode("utf-8", errors="replace").split("\n")
        unreadable: list[int] = []
        for number, line in enumerate(lines, start=1):
            try:
                self._read_line(line)
            except (ValueError, KeyError, TypeError):
                unreadable.append(number)
        # A last line without its end is one that a crash cut short; any other is damage that someone has to look at.
        self.is_torn = bool(last)
        self.unreadable_lines = tuple(unreadable)

    is_torn: bool = False
    unreadable_lines: tuple[int, ...] = ()

    def _read_line(self, line: str) -> None:
        if not line:
            return
        content = json.loads(line)
        piece = Piece.from_path(content["drop"] if "drop" in content else content["path"])
        if piece is None:
            raise DamagedStore(f"{self.path}: names a file outside the store: {line[:120]!r}")
        if "drop" in content:
            self._forget(piece)
            return
        self._keep(
            Record(
                piece,
                str(content["sha256"]),
                int(content["rows"]),
                int(content["bytes"]),
                int(content["schema_version"]),
            )
        )
