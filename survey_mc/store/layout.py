"""Where everything of a run lies, and what one stored file holds.

Idea     a file holds one table of one stage (named by its content key) for a contiguous range of realisations, so that
         its path is a pure function of what made it. Labels never enter a path: renaming a method moves nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

StoredTable = Literal["truth", "detections", "matches", "links"]
STORED_TABLES: tuple[StoredTable, ...] = ("truth", "detections", "matches", "links")
STORE_VERSION = "v1"
_PIECE_PATH = re.compile(
    rf"store/{STORE_VERSION}/(?P<table>{'|'.join(STORED_TABLES)})/(?P<key>[0-9a-f]{{32}})/(?P<start>\d{{7}})-(?P<stop>\d{{7}})\.parquet"
)


@dataclass(frozen=True, slots=True, order=True)
class Family:
    """All files of one table made by one stage; key: 32 hexadecimal digits."""

    table: StoredTable
    key: str


@dataclass(frozen=True, slots=True, order=True)
class Piece:
    """One file: the rows of a family for realisations start … stop − 1."""

    family: Family
    start: int
    stop: int

    @property
    def path(self) -> str:
        """Path relative to the run directory."""
        return f"store/{STORE_VERSION}/{self.family.table}/{self.family.key}/{self.start:07d}-{self.stop:07d}.parquet"

    @classmethod
    def from_path(cls, path: str) -> Piece | None:
        """The piece a relative path names, or None for anything else (a manifest cannot point outside the store)."""
        found = _PIECE_PATH.fullmatch(path)
        if found is None:
            return None
        table: StoredTable = found["table"]  # type: ignore[assignment]
        return cls(Family(table, found["key"]), int(found["start"]), int(found["stop"]))


@dataclass(frozen=True, slots=True)
class RunLayout:
    """Paths of a run directory."""

    root: Path

    @property
    def campaign(self) -> Path:
        return self.root / "campaign.toml"

    @property
    def lock_file(self) -> Path:
        """Resolved parameters and library versions (not the process lock)."""
        return self.root / "campaign.lock.json"

    @property
    def manifest(self) -> Path:
        return self.root / "manifest.jsonl"

    @property
    def store(self) -> Path:
        return self.root / "store" / STORE_VERSION

    @property
    def temporary(self) -> Path:
        return self.root / "store" / "tmp"

    @property
    def journals(self) -> Path:
        return self.root / "runs"

    @property
    def attempts(self) -> Path:
        """Notes of what the workers are at; gone when a run has ended."""
        return self.root / "attempts"

    @property
    def tables(self) -> Path:
        return self.root / "tables"

    @property
    def report(self) -> Path:
        return self.root / "report"

    @property
    def process_lock(self) -> Path:
        return self.root / ".lock"

    def piece_files(self) -> Iterator[str]:
        """Relative paths of all files below the store, whoever wrote them, sorted."""
        if self.store.is_dir():
            for path in sorted(self.store.rglob("*")):
                if path.is_file() or path.is_symlink():
                    yield path.relative_to(self.root).as_posix()
