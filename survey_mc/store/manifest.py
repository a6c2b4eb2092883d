"""The manifest: one line for each file that counts.

Idea     append and fsync; readers trust the manifest and never a directory listing. Only the process that holds the run
         lock appends, so lines never interleave. Every line has a checksum. A torn last line (a crash in the middle of
         an append) is dropped: its file is simply made again, with the same bytes under the same name. So is that of
         any damaged line: without its SHA-256 nobody knows whether a file is whole.
Limits   manifests of the first versions have no checksums; a line of theirs must still have the exact form it is
         written in. A manifest that was cut at the end of a line looks like that of a killed run.
"""

from __future__ import annotations

import json
import os
import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from survey_mc.errors import BadInput, DamagedStore
from survey_mc.store.files import is_plain, what_it_is, write_whole
from survey_mc.store.layout import STORE_VERSION, STORED_TABLES, Family, Piece, StoredTable
from survey_mc.store.sealed_text import is_sealed, opened, seal

MANIFEST_VERSION = 1  # a later one begins with a line that says which it is
REMEDY = "`survey-mc verify --repair` puts it right"

_NUMBER = r"(0|[1-9][0-9]{0,18})"
_RECORD = re.compile(
    rf'\{{"bytes": {_NUMBER}, "path": "([^"\\]*)", "rows": {_NUMBER}, "schema_version": {_NUMBER}, '
    r'"sha256": "([0-9a-f]{64})"\}'
)
_USUAL = re.compile(
    rf'\{{"bytes": {_NUMBER}, "path": "store/{STORE_VERSION}/({"|".join(STORED_TABLES)})/([0-9a-f]{{32}})/'
    rf'([0-9]{{7}})-([0-9]{{7}})\.parquet", "rows": {_NUMBER}, "schema_version": {_NUMBER}, '
    r'"sha256": "([0-9a-f]{64})", "crc": "[0-9a-f]{8}"\}\n'.encode()
)
_DROP = re.compile(r'\{"drop": "([^"\\]*)"\}')
_VERSION_LINE = re.compile(r'\{"manifest_version": ([0-9]{1,9})\b.*\}')
_OTHER_STORE = re.compile(r"store/v([0-9]{1,9})/.*")


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
            "bytes": self.size_bytes,
            "path": self.piece.path,
            "rows": self.rows,
            "schema_version": self.schema_version,
            "sha256": self.sha256,
        }
        return seal(json.dumps(content)) + "\n"


class _Damaged(Exception):
    """A line that cannot be used; the argument says why."""


class Manifest:
    """The committed files of a run, by family, in order of realisation.

    damaged_lines: what is wrong with the lines that cannot be used, by number. is_torn: whether the last line has no
    end. tolerant: take a manifest that names files outside the store, or is no file at all, for a damaged one instead
    of raising `DamagedStore`; what a later version wrote raises `BadInput` in any case.
    """

    def __init__(self, path: Path, *, tolerant: bool = False) -> None:
        self.path = path
        self.tolerant = tolerant
        self.is_torn = False
        self.damaged_lines: dict[int, str] = {}
        self._families: dict[Family, dict[tuple[int, int], Record]] = {}
        self._in_order: dict[Family, tuple[Record, ...]] = {}
        self._named: dict[tuple[bytes, bytes], Family] = {}
        if is_plain(path):
            self._read()
        elif what_it_is(path) and not tolerant:
            raise DamagedStore(f"{path}: is {what_it_is(path)}, not a file; {REMEDY}")

    def __iter__(self) -> Iterator[Record]:
        for family in sorted(self._families):
            yield from self.records(family)

    def __len__(self) -> int:
        return sum(len(records) for records in self._families.values())

    def __contains__(self, piece: object) -> bool:
        return isinstance(piece, Piece) and self.record(piece) is not None

    def record(self, piece: Piece) -> Record | None:
        """What the manifest says of a file, None if it does not count."""
        return self._families.get(piece.family, {}).get((piece.start, piece.stop))

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
            self._append("".join(seal(json.dumps({"drop": piece.path})) + "\n" for piece in gone))
            self.forget(gone)

    def forget(self, pieces: Iterable[Piece]) -> None:
        """Let these files no longer count, here; on disk they do until `compact`."""
        for piece in pieces:
            self._families.get(piece.family, {}).pop((piece.start, piece.stop), None)
            self._in_order.pop(piece.family, None)

    def compact(self) -> None:
        """Rewrite the manifest sorted and without dropped lines: equal stores have equal manifests."""
        content = "".join(record.line() for record in self).encode()
        if not is_plain(self.path) or self.path.read_bytes() != content:
            write_whole(self.path, content)

    def _append(self, text: str) -> None:
        handle = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
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

    def _read(self) -> None:
        with self.path.open("rb") as handle:
            for number, line in enumerate(handle, start=1):
                if self._read_usual(line):
                    continue
                try:
                    if line.endswith(b"\n"):
                        self._read_line(line[:-1], number)
                    else:
                        # A last line without its end is one that a crash cut short, unless it is whole up to there.
                        self.is_torn = True
                        if (opened(line[:-1]) or _RECORD.fullmatch(line[:-1].decode("ascii", "replace"))) is not None:
                            raise _Damaged("has another end than that of a line")
                except _Damaged as problem:
                    self.damaged_lines[number] = str(problem)

    def _read_usual(self, line: bytes) -> bool:
        """Take in a sound record as it is usually written, in a quarter of the time; whether it was one."""
        found = _USUAL.fullmatch(line)
        if found is None:
            return False
        size_bytes, table, key, start, stop, rows, schema_version, sha256 = found.groups()
        if opened(line[:-1]) is None or start >= stop:
            return False
        # One object for each family, however many files it has.
        family = self._named.get((table, key))
        if family is None:
            family = self._named[table, key] = Family(table.decode(), key.decode())  # type: ignore[arg-type]
        record = Record(
            Piece(family, int(start), int(stop)), sha256.decode(), int(rows), int(size_bytes), int(schema_version)
        )
        self._families.setdefault(family, {})[record.piece.start, record.piece.stop] = record
        return True

    def _read_line(self, line: bytes, number: int) -> None:
        if not line:
            return
        text = opened(line) if is_sealed(line) else line
        if text is None:
            raise _Damaged("has another checksum than when it was written")
        shown = text.decode("ascii", errors="replace")
        if number == 1 and (version := _VERSION_LINE.fullmatch(shown)):
            self._refuse_newer(f"has version {version[1]}", int(version[1]), f"{MANIFEST_VERSION}")
        elif record := _RECORD.fullmatch(shown):
            size_bytes, path, rows, schema_version, sha256 = record.groups()
            self._keep(Record(self._piece(path), sha256, int(rows), int(size_bytes), int(schema_version)))
        elif drop := _DROP.fullmatch(shown):
            self.forget([self._piece(drop[1])])
        else:
            raise _Damaged("cannot be read")

    def _piece(self, path: str) -> Piece:
        piece = Piece.from_path(path)
        if piece is not None:
            return piece
        other = _OTHER_STORE.fullmatch(path)
        # One changed letter of an older manifest does not make a later version: that has its own folder.
        if other and (self.path.parent / "store" / f"v{other[1]}").is_dir():
            self._refuse_newer(f"names files of store version v{other[1]}", int(other[1]), STORE_VERSION)
        if not self.tolerant:
            raise DamagedStore(f"{self.path}: names a file outside the store: {path[:120]!r}; {REMEDY}")
        raise _Damaged(f"names a file outside the store: {path[:120]!r}")

    def _refuse_newer(self, what: str, version: int, known: str) -> None:
        if version > int(known.removeprefix("v")):
            raise BadInput(str(self.path), f"{what}, this survey_mc reads {known}; install a newer survey_mc")
