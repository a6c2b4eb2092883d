"""The promise every procedure keeps to the rest of the pipeline, checked after every call.

Idea     the author of a procedure reads his own mistake as a sentence, not a failure three stages later.
Limits   it checks form and domain, not science.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from survey_mc.columns import Column
from survey_mc.detect._rows import COMMON_COLUMNS, typed_frame
from survey_mc.detect.detector import Detector
from survey_mc.errors import SurveyError
from survey_mc.types import Observation

ALWAYS_FINITE = ("x_pix", "y_pix", "offaxis_arcmin", "counts", "exposure_s", "background_per_pix", "significance")
NEVER_NEGATIVE = ("x_err_pix", "y_err_pix", "counts_err", "flux_err_cgs", "exposure_s", "r50_arcsec", "offaxis_arcmin")
KINDS_ALLOWED = {"int32": "iu", "int64": "iu", "float64": "fiu", "bool": "b", "string": "OUT"}


class DetectorContractError(SurveyError):
    """A procedure returned what it may not return."""

    def __init__(self, detector: Detector, problem: str) -> None:
        super().__init__(f"detector {detector.name!r} version {detector.version}: {problem}")


def declared_columns(detector: Detector) -> tuple[Column, ...]:
    """Columns of a procedure's detections: the common ones, then its own."""
    return COMMON_COLUMNS + detector.extra_columns


def check_detections(detector: Detector, observation: Observation, frame: pd.DataFrame) -> pd.DataFrame:
    """The frame in the declared order and dtypes, or DetectorContractError with the first thing wrong."""
    columns = declared_columns(detector)
    problem = frame_problem(columns, frame)
    if problem is None:
        frame = typed_frame({c.name: frame[c.name].to_numpy() for c in columns}, columns)
        problem = value_problem(observation, frame)
    if problem is not None:
        raise DetectorContractError(detector, problem)
    return frame


def frame_problem(columns: tuple[Column, ...], frame: pd.DataFrame) -> str | None:
    """What is wrong with the columns of a frame, as a sentence."""
    if not isinstance(frame, pd.DataFrame):
        return f"must return a pandas DataFrame or a Skip (got {type(frame).__name__})"
    names = [c.name for c in columns]
    missing = [name for name in names if name not in frame.columns]
    extra = [str(name) for name in frame.columns if name not in names]
    if missing or extra:
        parts = [f"{word} {', '.join(some)}" for word, some in (("missing", missing), ("undeclared", extra)) if some]
        return f"columns must be the declared ones ({'; '.join(parts)})"
    if len(frame.columns) != len(names):
        return "columns must be unique (a name appears twice)"
    for column in columns:
        dtype = frame[column.name].dtype
        kind = getattr(dtype, "kind", "O")
        if len(frame) and kind not in KINDS_ALLOWED[column.dtype]:
            return f"column {column.name} must hold {column.dtype} (got {dtype})"
        if kind in "iu" and len(frame) and column.dtype == "int32":
            values = frame[column.name]
            if values.max() > np.iinfo(np.int32).max or values.min() < np.iinfo(np.int32).min:
                return f"column {column.name} must fit into int32 (got {values.min()} … {values.max()})"
    return None


def value_problem(observation: Observation, frame: pd.DataFrame) -> str | None:
    """What is wrong with the values of a well-formed frame, as a sentence."""
    if not np.array_equal(frame["det_id"], np.arange(len(frame))):
        repeated = frame["det_id"][frame["det_id"].duplicated()]
        found = f"duplicate {repeated.iloc[0]}" if len(repeated) else f"starts {frame['det_id'].head(3).tolist()}"
        return f"det_id must count 0 … {len(frame) - 1} in row order ({found})"
    for name in ALWAYS_FINITE:
        bad = ~np.isfinite(frame[name])
        if bad.any():
            return f"{name} must be finite (got {frame[name][bad].iloc[0]} in row {int(np.argmax(bad))})"
    for name, n_pix in (("x_pix", observation.counts.shape[1]), ("y_pix", observation.counts.shape[0])):
        bad = (frame[name] < -0.5) | (frame[name] > n_pix - 0.5)
        if bad.any():
            return f"{name} must lie on the image, −0.5 … {n_pix - 0.5} (got {frame[name][bad].iloc[0]:g})"
    for name in NEVER_NEGATIVE:
        bad = (frame[name] < 0.0) | np.isinf(frame[name])
        if bad.any():
            return f"{name} must be ≥ 0 and finite, or NaN (got {frame[name][bad].iloc[0]:g})"
    return None
