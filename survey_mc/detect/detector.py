"""What a detection procedure is: a record of functions, not a base class.

Idea     one file a procedure, ending in `DETECTOR = Detector(...)`, and one line in the registry.
Limits   a procedure sees the observation, its parameters and a generator; it must not write into its inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from survey_mc.columns import Column
from survey_mc.types import FloatImage, Observation, Skip

if TYPE_CHECKING:
    from pandas import DataFrame


class DetectorParams(BaseModel):
    """Base of every procedure's parameters: frozen, strict about unknown keys, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def input_files(self) -> dict[str, str]:
        """Paths of the files that `detect` will read, by the parameter that names them; their content is part of the
        key of every result, and a campaign keeps copies of them."""
        return {}


@dataclass(frozen=True, slots=True)
class ExtentStatistic:
    """A column of a procedure's detections that tells points from extended sources, and the usual cut.

    column: of `columns.DETECTIONS` or of the procedure's `extra_columns`. unit: of the column; empty if none. cut: a
    detection is called extended at or above it, below it if `larger_is_extended` is false, and never where the column
    is NaN. about: where the cut comes from.
    """

    column: str
    label: str
    cut: float
    about: str
    unit: str = ""
    larger_is_extended: bool = True


# The two that every procedure of that kind shares.
R50 = ExtentStatistic(
    "r50_arcsec",
    "half-light radius",
    20.0,
    "Valtchanov, Pierre & Gastaud 2001, Sect. 7.3: r50 of at least 20″",
    "arcsec",
)
STELLARITY = ExtentStatistic(
    "stellarity",
    "stellarity index",
    0.1,
    "Valtchanov, Pierre & Gastaud 2001, Sect. 7.3: stellarity below 0.1",
    larger_is_extended=False,
)


@dataclass(frozen=True, slots=True)
class Detector:
    """A registered procedure.

    version: part of the key of every result; raise it when answers change. detect(obs, params, rng) returns a frame
    with the columns of `columns.DETECTIONS` (without `realisation`) followed by `extra_columns`, zero rows if nothing
    was found, or a `Skip`. view(obs, params): the filtered image the procedure searches, for reports. profiles: named
    sets of parameters; "paper" is the one a campaign starts from. tiny: parameters for quick contract tests.
    flag_bits: meaning of each bit of the column `flags`. check(params, shape): raises ValueError if the parameters do
    not fit an image of that shape, SurveyError if a file they name cannot be used. native_names: what the original
    program calls columns that mean the same in the same unit ({"SCTS": "counts"}); FITS catalogues carry both.
    extent_statistics: the columns that tell points from extended sources; `r50_arcsec` is tried for every procedure
    that fills it.
    """

    name: str
    label: str
    version: int
    about: str
    reference: str
    params: type[DetectorParams]
    detect: Callable[[Observation, Any, np.random.Generator], DataFrame | Skip]
    tiny: DetectorParams
    extra_columns: tuple[Column, ...] = ()
    view: Callable[[Observation, Any], FloatImage] | None = None
    profiles: Mapping[str, DetectorParams] = field(default_factory=dict)
    flag_bits: Mapping[int, str] = field(default_factory=dict)
    check: Callable[[Any, tuple[int, int]], None] | None = None
    native_names: Mapping[str, str] = field(default_factory=dict)
    extent_statistics: tuple[ExtentStatistic, ...] = ()
