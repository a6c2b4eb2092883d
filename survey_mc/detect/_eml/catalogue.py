"""From fitted sources to the rows of the catalogue, with the columns of emldetect.

Idea     counts are those expected at the exposure of the source's own pixel; likelihoods are put on the scale asked.
Source   columns of the XMM-SAS task emldetect.
Limits   one band, one instrument: no hardness ratios, no sums over rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from survey_mc.columns import Column
from survey_mc.detect._eml.params import EXTENDED_NU, EXTENT_NU, POINT_NU, Limits, MlFitParams, likelihood
from survey_mc.detect._eml.psf_table import PsfTable
from survey_mc.detect._eml.sliding_cell import Cells
from survey_mc.detect._shared.rows import Values, detections_frame, nearest_pixel
from survey_mc.types import FloatArray, Observation

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.detect._eml.groups import Fitted

ML_COLUMNS = (
    Column("EXT", "float64", "core radius of the β-model or σ of the Gaussian; 0: point", "pixel", "phys.angSize;src"),
    Column("EXT_ERR", "float64", "1σ error of EXT; NaN for a point", "pixel", "stat.error;phys.angSize"),
    Column("EXT_ML", "float64", "likelihood of the extent, −ln Q(1/2, ΔC/2); 0 for a point", ucd="stat.likelihood"),
    Column("LIKE", "float64", "likelihood −ln P of the candidate in the sliding cell", ucd="stat.likelihood"),
    Column("RATE_ERR", "float64", "1σ error of the rate", "ct / s", "stat.error;phot.count;arith.rate"),
    Column("CUTRAD", "float64", "radius of the pixels fitted", "pixel", "phys.angSize"),
    Column("MASKFRAC", "float64", "share of the model within CUTRAD on observed pixels", ucd="instr.obsty"),
    Column("VIGNETTING", "float64", "exposure at the position relative to the largest", ucd="instr.det.qe"),
    Column("DIST_NN", "float64", "distance to the nearest other detection; NaN: none", "arcsec", "pos.angDistance"),
    Column("BOX_ID_SRC", "int32", "number of the candidate in the sliding-cell list, from 1", ucd="meta.id"),
    Column("ID_CLUSTER", "int32", "number of the fit; sources fitted together share it", ucd="meta.id.assoc"),
    Column("N_FIT", "int32", "sources fitted together", ucd="meta.number"),
)  # fmt: skip

NATIVE_NAMES = {
    "DET_ML": "significance",
    "SCTS": "counts",
    "SCTS_ERR": "counts_err",
    "X_IMA_ERR": "x_err_pix",
    "Y_IMA_ERR": "y_err_pix",
    "RATE": "rate_cps",
    "FLUX": "flux_cgs",
    "FLUX_ERR": "flux_err_cgs",
    "EXP_MAP": "exposure_s",
    "BG_MAP": "background_per_pix",
    "OFFAX": "offaxis_arcmin",
    "FLAG": "flags",
}

FLAG_BITS = {
    1: "position at the bound of the fit",
    2: "extent at its largest value",
    4: "fit not converged",
    8: "part of the source on unobserved pixels",
    16: "split from another source's candidate",
    32: "a neighbour in the same fit was dropped",
    64: "errors uncertain: Fisher matrix singular",
}


def nearest_neighbour_arcsec(x_pix: FloatArray, y_pix: FloatArray, scale_arcsec: float) -> FloatArray:
    """Distance of each position to the nearest other one; NaN for a single one."""
    from scipy.spatial import cKDTree  # a driver does without

    if len(x_pix) < 2:
        return np.full(len(x_pix), np.nan)
    places = np.stack([x_pix, y_pix], axis=1)
    return np.asarray(cKDTree(places).query(places, k=2)[0][:, 1] * scale_arcsec)


def ml_catalogue(
    observation: Observation, fitted: Fitted, cells: Cells, table: PsfTable, limits: Limits, params: MlFitParams
) -> DataFrame:
    """Detections of the fitted sources."""
    from survey_mc.detect._eml.fit import AMPLITUDE, CANDIDATE, EXTENT, IS_EXTENDED, X, Y

    sources, scale, unit = fitted.sources, observation.grid.scale_arcsec, params.likelihood_unit
    x_pix, y_pix, extended = sources[:, X], sources[:, Y], sources[:, IS_EXTENDED] != 0.0
    extent = np.where(extended, limits.extent_pix(sources[:, EXTENT]), 0.0)
    exposure = observation.exposure_s[nearest_pixel(observation, x_pix, y_pix)]
    share = exposure / observation.exposure_s.max()
    candidate = sources[:, CANDIDATE].astype(np.int64)
    counts_err = fitted.errors[:, 2] * share
    values: Values = {
        "x_pix": x_pix,
        "y_pix": y_pix,
        "x_err_pix": fitted.errors[:, 0],
        "y_err_pix": fitted.errors[:, 1],
        "counts": sources[:, AMPLITUDE] * share,
        "counts_err": counts_err,
        "background_per_pix": fitted.background,
        "significance": unit * likelihood(fitted.fall, np.where(extended, EXTENDED_NU, POINT_NU)),
        "r50_arcsec": table.half_energy_pix(extent) * scale,
        "flags": fitted.flags,
        "EXT": extent,
        "EXT_ERR": extent * fitted.errors[:, 3] * limits.extent_step,
        "EXT_ML": np.where(extended, unit * likelihood(fitted.extent_fall, EXTENT_NU), 0.0),
        "LIKE": cells.like[candidate],
        "RATE_ERR": counts_err / exposure,
        "CUTRAD": np.full(len(sources), limits.cut_pix),
        "MASKFRAC": fitted.observed_share,
        "VIGNETTING": share,
        "DIST_NN": nearest_neighbour_arcsec(x_pix, y_pix, scale),
        "BOX_ID_SRC": cells.box_id[candidate],
        "ID_CLUSTER": fitted.group,
        "N_FIT": fitted.n_together,
    }
    return detections_frame(observation, values, ML_COLUMNS)
