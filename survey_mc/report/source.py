"""What a report needs of a run; `store.RunData` is one.

Idea     the report reads through these protocols, so that a test can give it numbers made by hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

from survey_mc.types import FloatImage, Observation

if TYPE_CHECKING:
    from pandas import DataFrame


class CellLike(Protocol):
    """One combination of the campaign's grid."""

    @property
    def label(self) -> str: ...
    @property
    def instrument(self) -> str: ...
    @property
    def band(self) -> str: ...
    @property
    def exposure_ks(self) -> float: ...
    @property
    def realisations(self) -> int: ...
    @property
    def counts_min(self) -> float: ...
    @property
    def region_arcmin(self) -> float: ...
    @property
    def region_deg2(self) -> float: ...
    @property
    def radius_arcsec(self) -> float: ...
    @property
    def rule(self) -> str: ...


class MethodLike(Protocol):
    """A procedure (`name`) under the campaign's label for it."""

    @property
    def name(self) -> str: ...
    @property
    def label(self) -> str: ...


class RunSource(Protocol):
    """A run opened for reading."""

    @property
    def lock(self) -> dict[str, Any]: ...
    @property
    def cells(self) -> Sequence[CellLike]: ...
    @property
    def methods(self) -> Sequence[MethodLike]: ...

    def frames(
        self,
        table: Literal["truth", "matches", "detections"],
        cell_label: str,
        method_label: str = "",
        columns: Sequence[str] | None = None,
    ) -> Iterator[DataFrame]:
        """Stored rows, piece by piece."""

    def realisations_done(
        self, table: Literal["truth", "matches", "detections"], cell_label: str, method_label: str = ""
    ) -> int:
        """How many fields are stored, those without rows included."""

    def journal(self) -> DataFrame:
        """Columns cell, method ("" for drawing), stage, fields, cpu_s, wall_s."""


@dataclass(frozen=True, slots=True)
class FieldPicture:
    """One field to look at, drawn again by the caller.

    title: which cell and realisation. truth, and by method label: detections, matches (both rules), and the filtered
    images a method searches (only for methods that have one).
    """

    title: str
    observation: Observation
    truth: DataFrame
    detections: Mapping[str, DataFrame]
    matches: Mapping[str, DataFrame]
    views: Mapping[str, FloatImage] = field(default_factory=dict)
    region_arcmin: float = 10.0
    rule: str = "nearest"
