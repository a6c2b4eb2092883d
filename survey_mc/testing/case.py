"""A procedure on trial: its parameters, the tolerances, and the fields that several claims look at.

Idea     fields and answers that more than one claim needs are made once. Everything random hangs on the seed.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.detect import Detector, DetectorParams, check_detections
from survey_mc.rng import stream
from survey_mc.testing import fields
from survey_mc.testing.fields import Drawn
from survey_mc.testing.tolerances import Tolerances
from survey_mc.types import FloatArray, FloatImage, Observation, Skip

if TYPE_CHECKING:
    from pandas import DataFrame

PLAIN_COUNTS = 400.0
PLAIN_COLUMNS, PLAIN_ROWS = 4, 4


class Skipped(Exception):
    """The procedure returned a `Skip` instead of rows."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(slots=True)
class Case:
    """One procedure with one set of parameters; claims call `find` and compare."""

    detector: Detector
    params: DetectorParams
    tolerances: Tolerances = dataclass_field(default_factory=Tolerances)
    seed: int = 0
    grants_background: bool = False
    _plain: Drawn | None = None
    _plain_rows: DataFrame | None = None

    def rng(self, name: str) -> np.random.Generator:
        """The generator of a field or of the procedure; equal names give equal streams."""
        return stream(f"conformance/{self.seed}", name)

    def find(self, observation: Observation, params: DetectorParams | None = None) -> DataFrame:
        """The rows of the procedure, checked against the contract; raises `Skipped` if it gives none."""
        found = self.detector.detect(observation, params or self.params, self.rng("detect"))
        if isinstance(found, Skip):
            raise Skipped(found.reason)
        return check_detections(self.detector, observation, found)

    def draw(
        self,
        name: str,
        positions: FloatArray,
        counts: float | FloatArray,
        *,
        background_per_pix: float = fields.BACKGROUND_PER_PIX,
        share: FloatImage | None = None,
        shape: tuple[int, int] = fields.SHAPE,
    ) -> Drawn:
        """A field of that name with these sources."""
        return fields.draw(
            self.rng(name),
            positions,
            np.broadcast_to(np.asarray(counts, dtype=np.float64), len(positions)),
            background_per_pix=background_per_pix,
            share=share,
            shape=shape,
            grants_background=self.grants_background,
        )

    def blank(self, name: str, *, share: FloatImage | None = None, background_per_pix: float) -> Observation:
        """A field of that name without sources."""
        return self.draw(name, np.zeros((0, 2)), 0.0, share=share, background_per_pix=background_per_pix).observation

    @property
    def plain(self) -> Drawn:
        """16 isolated sources of 400 photons on a flat sky."""
        if self._plain is None:
            positions = fields.lattice(self.rng("plain positions"), PLAIN_COLUMNS, PLAIN_ROWS)
            self._plain = self.draw("plain", positions, PLAIN_COUNTS)
        return self._plain

    @property
    def plain_rows(self) -> DataFrame:
        """What the procedure finds on the plain field."""
        if self._plain_rows is None:
            self._plain_rows = self.find(self.plain.observation)
        return self._plain_rows


def positions_of(rows: DataFrame) -> FloatArray:
    """(n, 2) x, y of detections."""
    return np.asarray(rows[["x_pix", "y_pix"]].to_numpy(dtype=np.float64))


def pixels_of(rows: DataFrame, shape: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(row, column) of the pixel that holds each detection."""
    column, row = np.rint(positions_of(rows)).astype(np.int64).T
    return np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1)


def nearest(rows: DataFrame, positions: FloatArray) -> tuple[DataFrame, FloatArray]:
    """The detection nearest to each position, and its distance in pixels; rows must not be empty."""
    found = positions_of(rows)
    distance = np.hypot(found[:, 0, None] - positions[:, 0], found[:, 1, None] - positions[:, 1])
    return rows.iloc[distance.argmin(axis=0)].reset_index(drop=True), distance.min(axis=0)
