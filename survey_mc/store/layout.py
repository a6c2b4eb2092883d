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

from survey_mc.errors import BadInput
from survey_mc.store.files import entries, what_it_is

StoredTable = Literal["truth", "detections", "matches", "links"]
STORED_TABLES: tuple[StoredTable, ...] = ("truth", "detections", "matches", "links")
STORE_VERSION = "v1"
_PIECE_PATH = re.compile(
    rf"store/{STORE_VERSION}/(?P<table>{'|'.join(STORED_TABLES)})/(?P<key>[0-9a-f]{{32}})/(?P<start>[0-9]{{7,8}})-(?P<stop>[0-9]{{7,8}})\.parquet"
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
        piece = cls(Family(table, found["key"]), int(found["start"]), int(found["stop"]))
        return piece if piece.start < piece.stop and piece.path == path else None


_JOURNAL_NAME = re.compile(r"[0-9]{8}T[0-9]{6}\.[0-9]{6}Z-[0-9]+\.jsonl")

# Folders of a run directory in which every file is the run's own; beside them anybody may put what he likes.
STORE_FOLDER = "store"
OWN_FOLDERS = ("attempts", "inputs", "report", "runs", STORE_FOLDER, "tables")


def is_journal_name(name: str) -> bool:
    """Whether a file of that name is a journal: a time and the number of a process."""
    return _JOURNAL_NAME.fullmatch(name) is not None


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
        return self.root / STORE_FOLDER / STORE_VERSION

    @property
    def temporary(self) -> Path:
        return self.root / STORE_FOLDER / "tmp"

    @property
    def journals(self) -> Path:
        return self.root / "runs"

    @property
    def attempts(self) -> Path:
        """Notes of what the workers are at; gone when a run has ended."""
        return self.root / "attempts"

    @property
    def inputs(self) -> Path:
        """Copies of the files that the campaign names."""
        return self.root / "inputs"

    @property
    def tables(self) -> Path:
        return self.root / "tables"

    @property
    def report(self) -> Path:
        return self.root / "report"

    @property
    def digests(self) -> Path:
        """SHA-256 of what the report made, for `sha256sum -c`."""
        return self.root / "tables.sha256"

    @property
    def strays(self) -> Path:
        """Where a repair puts what it found and did not make."""
        return self.root / "strays"

    @property
    def process_lock(self) -> Path:
        return self.root / ".lock"

    def refuse_linked_folders(self) -> None:
        """Raise `BadInput` if one of the run's own folders is a link: what is written or tidied must lie in the run."""
        for name in OWN_FOLDERS:
            if what_it_is(self.root / name) == "a link":
                raise BadInput(
                    str(self.root / name),
                    "is a link, and a run writes nothing outside its directory; put the whole run directory on the "
                    "other disk",
                )

    def piece_files(self) -> Iterator[str]:
        """Relative paths of everything below the store that is no folder, whoever put it there, in order."""
        for path in entries(self.store):
            yield path.relative_to(self.root).as_posix()

    def journal_files(self) -> Iterator[Path]:
        """The journals, oldest first; what has the name of one and is no regular file is among them."""
        for path in entries(self.journals):
            if path.parent == self.journals and is_journal_name(path.name):
                yield path
