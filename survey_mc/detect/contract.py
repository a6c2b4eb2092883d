"""The promise every procedure keeps to the rest of the pipeline: its record, and the rows of every call.

Idea     the author of a procedure reads his own mistake as a sentence, not a failure three stages later.
Limits   it checks form and domain, not science; `survey_mc.testing` checks behaviour.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame, Texts, arrays_of
from survey_mc.columns import REALISATION, SKY_COLUMNS_OF_CATALOGUE, Column
from survey_mc.detect._shared.rows import COMMON_COLUMNS, DTYPES
from survey_mc.detect.detector import Detector
from survey_mc.errors import SurveyError
from survey_mc.types import Observation

if TYPE_CHECKING:
    from pandas import DataFrame
ALWAYS_FINITE = ("x_pix", "y_pix", "offaxis_arcmin", "counts", "exposure_s", "background_per_pix", "significance")
NEVER_NEGATIVE = ("x_err_pix", "y_err_pix", "counts_err", "flux_err_cgs", "exposure_s", "r50_arcsec", "offaxis_arcmin")
KINDS_ALLOWED = {"int32": "iu", "int64": "iu", "float64": "fiu", "bool": "b", "string": "OUT"}
DEFAULT_PROFILE = "paper"  # what a campaign starts from unless it names another


class DetectorContractError(SurveyError):
    """A procedure returned what it may not return."""

    def __init__(self, detector: Detector, problem: str) -> None:
        super().__init__(f"detector {detector.name!r} version {detector.version}: {problem}")


def declared_columns(detector: Detector) -> tuple[Column, ...]:
    """Columns of a procedure's detections: the common ones, then its own."""
    return COMMON_COLUMNS + detector.extra_columns


def native_columns(detector: Detector) -> tuple[tuple[Column, str], ...]:
    """Columns under the names of the original program, each with the declared column whose values it repeats."""
    declared = {c.name: c for c in declared_columns(detector)}
    return tuple(
        (Column(native, same.dtype, f"{name}: {same.about}", same.unit, same.ucd), name)
        for native, name in detector.native_names.items()
        for same in (declared[name],)
    )


def with_native_names(detector: Detector, frame: DataFrame) -> DataFrame:
    """Detections with the columns the original program names otherwise once more under its names (DET_ML, SCTS …)."""
    return frame.assign(**{column.name: frame[name] for column, name in native_columns(detector)})


def record_problem(detector: Detector) -> str | None:
    """What is wrong with a procedure's record, as a sentence."""
    return _profile_problem(detector) or _column_problem(detector) or _flag_problem(detector)


def _profile_problem(detector: Detector) -> str | None:
    if not detector.name.isidentifier():
        return f"name must be an identifier such as my_method (got {detector.name!r})"
    if detector.version < 1:
        return f"version must count from 1 (got {detector.version})"
    for word in ("label", "about", "reference"):
        if not getattr(detector, word).strip():
            return f"{word} must say something (got an empty text)"
    if DEFAULT_PROFILE not in detector.profiles:
        return f"profiles must have {DEFAULT_PROFILE!r}, the set a campaign starts from (got {[*detector.profiles]})"
    for name, params in (*detector.profiles.items(), ("tiny", detector.tiny)):
        if not isinstance(params, detector.params):
            return f"profile {name!r} must be {detector.params.__name__} (got {type(params).__name__})"
    undescribed = [name for name, info in detector.params.model_fields.items() if not info.description]
    if undescribed:
        return f"every parameter needs a description with its unit (missing: {', '.join(undescribed)})"
    if detector.params.model_config.get("extra") != "forbid" or not detector.params.model_config.get("frozen"):
        return "params must be frozen and forbid unknown keys, as DetectorParams does"
    return None


def _column_problem(detector: Detector) -> str | None:
    for column in detector.extra_columns:
        if column.dtype not in KINDS_ALLOWED:
            return f"extra column {column.name} must be one of {', '.join(KINDS_ALLOWED)} (got {column.dtype})"
        if not column.about.strip():
            return f"extra column {column.name} must say what it means"
        if not column.name.isidentifier():
            return f"extra column {column.name!r} must be an identifier"
    declared = [c.name for c in declared_columns(detector)]
    for native, name in detector.native_names.items():
        if name not in declared:
            return f"native name {native} must stand for a declared column (got {name!r})"
    taken: dict[str, str] = {}
    # FITS does not tell capitals from small letters: one name, one column.
    for name in (REALISATION.name, *(c.name for c in SKY_COLUMNS_OF_CATALOGUE), *declared, *detector.native_names):
        if name.lower() in taken:
            return f"column names must differ in more than capitals ({taken[name.lower()]} and {name})"
        taken[name.lower()] = name
    return None


def _flag_problem(detector: Detector) -> str | None:
    for bit, meaning in detector.flag_bits.items():
        if bit.bit_count() != 1 or not 0 < bit < 1 << 31:
            return f"flag_bits must be single bits of an int32 (got {bit})"
        if not meaning.strip():
            return f"flag_bits must say what bit {bit} means"
    return None


def check_detections(detector: Detector, observation: Observation, frame: DataFrame) -> DataFrame:
    """The frame in the declared order and dtypes, or DetectorContractError with the first thing wrong."""
    return checked_rows(detector, observation, frame).frame()


def checked_rows(detector: Detector, observation: Observation, frame: DataFrame) -> ArrayFrame:
    """`check_detections` with the result as plain arrays."""
    columns = declared_columns(detector)
    problem = name_problem(columns, frame)
    if problem is None:
        arrays = arrays_of(frame)
        problem = type_problem(columns, frame, arrays)
    if problem is None:
        rows = _typed_rows(columns, arrays)
        problem = value_problem(observation, rows)
    if problem is not None:
        raise DetectorContractError(detector, problem)
    return rows


def _typed_rows(columns: tuple[Column, ...], arrays: Mapping[str, NDArray[Any]]) -> ArrayFrame:
    typed: dict[str, NDArray[Any]] = {c.name: arrays[c.name].astype(DTYPES[c.dtype], copy=False) for c in columns}
    return ArrayFrame({name: Texts.of(a.tolist()) if a.dtype.kind == "U" else a for name, a in typed.items()})


def name_problem(columns: tuple[Column, ...], frame: DataFrame) -> str | None:
    """What is wrong with the columns of a frame, as a sentence."""
    from pandas import DataFrame  # a driver does without

    if not isinstance(frame, DataFrame):
        return f"must return a pandas DataFrame or a Skip (got {type(frame).__name__})"
    names, given = [c.name for c in columns], frame.columns.tolist()
    if given == names:
        return None
    missing = [name for name in names if name not in given]
    extra = [str(name) for name in given if name not in names]
    if missing or extra:
        parts = [f"{word} {', '.join(some)}" for word, some in (("missing", missing), ("undeclared", extra)) if some]
        return f"columns must be the declared ones ({'; '.join(parts)})"
    return "columns must be unique (a name appears twice)" if len(given) != len(names) else None


def type_problem(columns: tuple[Column, ...], frame: DataFrame, arrays: Mapping[str, NDArray[Any]]) -> str | None:
    """What is wrong with the types of the declared columns, as a sentence; no rows may have any type."""
    for column in columns:
        values = arrays[column.name]
        if len(values) and values.dtype.kind not in KINDS_ALLOWED[column.dtype]:
            return f"column {column.name} must hold {column.dtype} (got {frame[column.name].dtype})"
        if len(values) and column.dtype == "int32" and values.dtype != np.int32:
            low, high = values.min(), values.max()
            if high > np.iinfo(np.int32).max or low < np.iinfo(np.int32).min:
                return f"column {column.name} must fit into int32 (got {low} … {high})"
    return None


def value_problem(observation: Observation, rows: ArrayFrame) -> str | None:
    """What is wrong with the values of well-formed rows, as a sentence."""
    det_id = rows["det_id"]
    if not np.array_equal(det_id, np.arange(len(rows))):
        number, how_often = np.unique(det_id, return_counts=True)
        repeated = number[how_often > 1]
        found = f"duplicate {repeated[0]}" if len(repeated) else f"starts {det_id[:3].tolist()}"
        return f"det_id must count 0 … {len(rows) - 1} in row order ({found})"
    for name in ALWAYS_FINITE:
        bad = ~np.isfinite(rows[name])
        if bad.any():
            return f"{name} must be finite (got {rows[name][bad][0]} in row {int(np.argmax(bad))})"
    for name, n_pix in (("x_pix", observation.counts.shape[1]), ("y_pix", observation.counts.shape[0])):
        bad = (rows[name] < -0.5) | (rows[name] > n_pix - 0.5)
        if bad.any():
            return f"{name} must lie on the image, −0.5 … {n_pix - 0.5} (got {rows[name][bad][0]:g})"
    for name in NEVER_NEGATIVE:
        bad = (rows[name] < 0.0) | np.isinf(rows[name])
        if bad.any():
            return f"{name} must be ≥ 0 and finite, or NaN (got {rows[name][bad][0]:g})"
    return None
