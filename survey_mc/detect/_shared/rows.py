"""From measured values to the rows of the detections table; the common end of every procedure.

Idea     a procedure gives positions, counts, errors and its own columns; exposure, rate, flux and off-axis angle follow
         from them in one way for all. Rows are ordered by decreasing significance, then y, then x.
Limits   a position in an unobserved pixel is no detection: its row is dropped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.columns import DETECTIONS, REALISATION, Column
from survey_mc.types import FloatArray, Observation
from survey_mc.units import flux_from_rate

if TYPE_CHECKING:
    from pandas import DataFrame
Values = dict[str, NDArray[Any]]

COMMON_COLUMNS = tuple(c for c in DETECTIONS.columns if c is not REALISATION)
DTYPES = {"int32": np.int32, "int64": np.int64, "float64": np.float64, "bool": np.bool_, "string": np.str_}


def empty_frame(columns: tuple[Column, ...]) -> DataFrame:
    """No rows, all columns with their declared dtypes."""
    return typed_frame({c.name: np.zeros(0) for c in columns}, columns)


def typed_frame(values: Mapping[str, NDArray[Any]], columns: tuple[Column, ...]) -> DataFrame:
    """Frame with the declared columns, in their order and with their dtypes."""
    import pandas as pd  # a driver does without

    return pd.DataFrame({c.name: np.asarray(values[c.name]).astype(DTYPES[c.dtype]) for c in columns})


def nearest_pixel(observation: Observation, x_pix: FloatArray, y_pix: FloatArray) -> tuple[NDArray[Any], NDArray[Any]]:
    """(row, column) of the pixel that holds each position; positions beyond the image take its border."""
    height, width = observation.counts.shape
    row = np.clip(np.rint(y_pix).astype(np.int64), 0, height - 1)
    column = np.clip(np.rint(x_pix).astype(np.int64), 0, width - 1)
    return row, column


def rates_and_fluxes(observation: Observation, values: Values) -> Values:
    """offaxis_arcmin, rate_cps, flux_cgs and flux_err_cgs of values with positions, counts and exposure_s (> 0)."""
    factor = observation.band.flux_per_rate_cgs
    rate_per_count = 1.0 / values["exposure_s"]
    flux_per_count = rate_per_count * np.nan if factor is None else np.asarray(flux_from_rate(rate_per_count, factor))
    return {
        "offaxis_arcmin": observation.grid.offaxis_arcmin(values["x_pix"], values["y_pix"]),
        "rate_cps": values["counts"] / values["exposure_s"],
        "flux_cgs": values["counts"] * flux_per_count,
        "flux_err_cgs": values["counts_err"] * flux_per_count,
    }


def ordered_frame(values: Values, columns: tuple[Column, ...]) -> DataFrame:
    """Rows by decreasing significance, then y, then x, numbered from 0 in that order."""
    order = np.lexsort((values["x_pix"], values["y_pix"], -values["significance"]))
    values = {**values, "det_id": np.argsort(order)}
    return typed_frame(values, columns).iloc[order].reset_index(drop=True)


def detections_frame(observation: Observation, values: Values, extra_columns: tuple[Column, ...]) -> DataFrame:
    """The detections of a procedure.

    values: (n,) arrays x_pix, y_pix, x_err_pix, y_err_pix, counts, counts_err, background_per_pix, significance,
    r50_arcsec, flags and those of `extra_columns`. Positions must lie on the image.
    """
    exposure_s = observation.exposure_s[nearest_pixel(observation, values["x_pix"], values["y_pix"])]
    seen = exposure_s > 0.0
    kept = {name: np.asarray(value)[seen] for name, value in values.items()}
    kept["exposure_s"] = exposure_s[seen]
    kept |= rates_and_fluxes(observation, kept)
    return ordered_frame(kept, COMMON_COLUMNS + extra_columns)
