"""One thing that is wrong with a run directory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from survey_mc.shown import shown
from survey_mc.store.layout import Piece

Kind = Literal[
    "missing",
    "changed",
    "unreadable",
    "schema",
    "rows",
    "manifest",
    "lock",
    "campaign",
    "journal",
    "table",
    "extra",
    "leftover",
]


@dataclass(frozen=True, slots=True)
class Damage:
    """kind; path relative to the run directory; about: what was expected.

    missing, changed, unreadable, schema, rows: of a stored file. manifest, lock, campaign (with its inputs), journal,
    table (with the report): of these. extra: something that the run did not put there. leftover: what a killed run
    left, which is no damage.
    """

    kind: Kind
    path: str
    about: str

    @property
    def piece(self) -> Piece | None:
        """The stored file it is about, by its name."""
        return Piece.from_path(self.path)

    @property
    def shown(self) -> str:
        """The path as it can be printed, whatever somebody has named his file."""
        return shown(self.path)
