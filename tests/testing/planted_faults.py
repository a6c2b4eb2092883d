"""Sound procedures made unsound, each in one way, with the claim that must notice it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np
import pandas as pd
from pydantic import Field, field_validator

from survey_mc.columns import Column
from survey_mc.detect import DETECTORS, Detector, DetectorParams
from survey_mc.testing import Case
from survey_mc.types import Observation, Skip

SOUND = DETECTORS["gauss_se"]
Fault = tuple[str, str, Detector]
Change = Callable[[Observation, pd.DataFrame], pd.DataFrame]


def ranked(rows: pd.DataFrame) -> pd.DataFrame:
    rows = rows.sort_values("significance", ascending=False, kind="stable").reset_index(drop=True)
    return rows.assign(det_id=np.arange(len(rows)))


def changed(change: Change) -> Detector:
    """The rows are changed after a sound search."""
    return replace(SOUND, detect=lambda obs, params, rng: change(obs, SOUND.detect(obs, params, rng)))


def misled(change: Callable[[Observation], Observation]) -> Detector:
    """The search is sound, but on something else than what was observed."""
    return replace(SOUND, detect=lambda obs, params, rng: SOUND.detect(change(obs), params, rng))


def failing(when: Callable[[Observation], bool], error: Exception) -> Detector:
    def detect(obs: Observation, params: DetectorParams, rng: np.random.Generator) -> pd.DataFrame:
        if when(obs):
            raise error
        return SOUND.detect(obs, params, rng)

    return replace(SOUND, detect=detect)


def bounded(rows: pd.DataFrame, obs: Observation) -> pd.DataFrame:
    height, width = obs.counts.shape
    return rows.assign(x_pix=rows["x_pix"].clip(0, width - 1), y_pix=rows["y_pix"].clip(0, height - 1))


def moved_by(dx: Callable[[pd.DataFrame], pd.Series | float]) -> Change:
    return lambda obs, rows: bounded(rows.assign(x_pix=rows["x_pix"] + dx(rows)), obs)


def transposed(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    return bounded(rows.assign(x_pix=rows["y_pix"], y_pix=rows["x_pix"]), obs)


def rows_at(obs: Observation, rows: pd.DataFrame, y: np.ndarray, x: np.ndarray) -> pd.DataFrame:
    """The rows, and further ones at these pixels."""
    if not len(x):
        return rows
    example = Case(SOUND, SOUND.tiny).plain_rows
    further = example.iloc[np.zeros(len(x), dtype=int)].assign(x_pix=x * 1.0, y_pix=y * 1.0)
    return ranked(pd.concat([rows, further], ignore_index=True) if len(rows) else further)


def along_masks(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    seen = obs.exposure_s > 0.0
    y, x = np.nonzero(seen[:, :-1] & ~seen[:, 1:])
    return rows_at(obs, rows, y[::8], x[::8])


def inside_masks(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    y, x = np.nonzero(obs.exposure_s == 0.0)
    return rows_at(obs, rows, y[:1], x[:1])


def along_borders(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    y = np.arange(4, obs.counts.shape[0], 8)
    return rows_at(obs, rows, y, np.full(len(y), 2))


def far_from_borders(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    height, width = obs.counts.shape
    return ranked(rows[rows["x_pix"].between(9, width - 10) & rows["y_pix"].between(9, height - 10)])


def far_from_masks(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    x, y = rows["x_pix"].round().astype(int).to_numpy(), rows["y_pix"].round().astype(int).to_numpy()
    ahead = np.minimum(x + 7, obs.counts.shape[1] - 1)
    return ranked(rows[obs.exposure_s[y, ahead] > 0.0])


def at_full_exposure(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    full = obs.exposure_s.max()
    return rows.assign(exposure_s=full, rate_cps=rows["counts"] / full)


def writing(obs: Observation) -> Observation:
    obs.counts.setflags(write=True)
    obs.counts[0, 0] += 1
    obs.counts.setflags(write=False)
    return obs


def unlocking(obs: Observation) -> Observation:
    obs.exposure_s.setflags(write=True)
    return obs


def of_the_later_photons(obs: Observation) -> Observation:
    if obs.photons_pix is None or len(obs.photons_pix) < 1000:
        return obs
    column, row = np.rint(obs.photons_pix[len(obs.photons_pix) // 2 :]).astype(int).T
    counts = np.zeros_like(obs.counts)
    np.add.at(counts, (row, column), 1)
    return replace(obs, counts=counts)


def remembering() -> Detector:
    calls = count()
    return changed(lambda obs, rows: rows.assign(background_per_pix=rows["background_per_pix"] + next(calls)))


def with_global_random_numbers(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(background_per_pix=np.random.random(len(rows)))  # noqa: NPY002


def with_own_generator(obs: Observation, rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(background_per_pix=np.random.default_rng().random(len(rows)))


def is_small(obs: Observation) -> bool:
    return min(obs.counts.shape) < 8


class DriftingParams(type(SOUND.tiny)):  # type: ignore[misc]
    """A parameter that is another one after each reading."""

    drift: float = Field(1.0, description="grows (no unit)")

    @field_validator("drift")
    @classmethod
    def _grow(cls, value: float) -> float:
        return value + 1.0


DRIFTING = DriftingParams(drift=2.0)
WORD = Column("shape_word", "string", "a word for the shape")

FAULTS: tuple[Fault, ...] = (
    ("half a pixel off", "pixel_origin_is_the_first_centre", changed(moved_by(lambda rows: 0.5))),
    ("axes swapped", "bright_sources_are_found_in_place", changed(transposed)),
    ("far off", "bright_sources_are_found_in_place", changed(moved_by(lambda rows: 5.0))),
    ("off along x only", "turned_sky_gives_turned_sources", changed(moved_by(lambda rows: 0.4))),
    ("off by place", "shifted_sky_gives_shifted_sources", changed(moved_by(lambda rows: np.sin(rows["x_pix"] / 15.0)))),
    ("writes into counts", "inputs_are_not_written", misled(writing)),
    ("unlocks the exposure", "inputs_are_not_written", misled(unlocking)),
    ("global random numbers", "global_random_state_is_not_used", changed(with_global_random_numbers)),
    ("a generator of its own", "same_input_same_rows", changed(with_own_generator)),
    ("memory of calls", "same_input_same_rows", remembering()),
    ("order of photons", "photon_order_does_not_matter", misled(of_the_later_photons)),
    ("unsorted", "rows_are_ranked", changed(lambda obs, f: f[::-1].assign(det_id=np.arange(len(f))))),
    ("rows twice", "rows_are_distinct", changed(lambda obs, f: ranked(pd.concat([f, f])))),
    ("det_id from 1", "rows_are_valid", changed(lambda obs, f: f.assign(det_id=f["det_id"] + 1))),
    ("NaN positions", "rows_are_valid", changed(lambda obs, f: f.assign(x_pix=np.nan))),
    ("an undeclared column", "rows_are_valid", changed(lambda obs, f: f.assign(colour=1.0))),
    ("a missing column", "rows_are_valid", changed(lambda obs, f: f.drop(columns="counts"))),
    ("a wrong type", "rows_are_valid", changed(lambda obs, f: f.assign(flags=0.5))),
    ("negative errors", "rows_are_valid", changed(lambda obs, f: f.assign(counts_err=-f["counts_err"]))),
    ("nothing found", "rows_are_valid", changed(lambda obs, f: f[:0])),
    ("always a skip", "rows_are_valid", replace(SOUND, detect=lambda *_: Skip("no time"))),
    ("not a frame", "rows_are_valid", replace(SOUND, detect=lambda *_: [1, 2, 3])),
    ("unknown flags", "flags_are_documented", changed(lambda obs, f: f.assign(flags=1 << 20))),
    (
        "flags of a crowd",
        "crowded_field_is_survived",
        changed(lambda obs, f: f.assign(flags=f["flags"] | (1 << 20) * (len(f) > 60))),
    ),
    ("no photon list", "photon_list_is_optional", failing(lambda obs: obs.photons_pix is None, TypeError("None"))),
    (
        "a skip without a reason",
        "photon_list_is_optional",
        replace(SOUND, detect=lambda obs, p, rng: Skip("") if obs.photons_pix is None else SOUND.detect(obs, p, rng)),
    ),
    ("a view of a part", "view_is_an_image", replace(SOUND, view=lambda obs, params: obs.counts[:9, :9] * 1.0)),
    ("a view with NaN", "view_is_an_image", replace(SOUND, view=lambda obs, params: obs.counts / obs.exposure_s * 0.0)),
    ("NaN errors of counts", "errors_are_numbers", changed(lambda obs, f: f.assign(counts_err=np.nan))),
    ("error of one axis", "errors_are_numbers", changed(lambda obs, f: f.assign(x_err_pix=np.nan))),
    (
        "errors too small",
        "position_errors_are_the_scatter",
        changed(lambda obs, f: f.assign(x_err_pix=f["x_err_pix"] / 50.0, y_err_pix=f["y_err_pix"] / 50.0)),
    ),
    ("counts twice", "counts_are_those_of_the_source", changed(lambda obs, f: f.assign(counts=2.0 * f["counts"]))),
    (
        "variance as error",
        "counts_are_those_of_the_source",
        changed(lambda obs, f: f.assign(counts_err=f["counts_err"] ** 2)),
    ),
    ("another rate", "rates_follow_from_counts", changed(lambda obs, f: f.assign(rate_cps=f["counts"] / 1e3))),
    ("fluxes made up", "rates_follow_from_counts", changed(lambda obs, f: f.assign(flux_cgs=f["flux_cgs"].fillna(0)))),
    (
        "off-axis in pixels",
        "rates_follow_from_counts",
        changed(lambda obs, f: f.assign(offaxis_arcmin=f["offaxis_arcmin"] * 15)),
    ),
    ("blind to vignetting", "vignetting_is_corrected", changed(at_full_exposure)),
    ("crash on empty", "empty_image_gives_no_rows", failing(lambda obs: not obs.counts.any(), ZeroDivisionError())),
    ("crash on one", "one_photon_is_survived", failing(lambda obs: obs.counts.sum() == 1, IndexError("too few"))),
    (
        "blind to no exposure",
        "unobserved_image_gives_no_rows",
        misled(lambda obs: replace(obs, exposure_s=np.where(obs.exposure_s.any(), obs.exposure_s, 1.0))),
    ),
    (
        "NaN accepted",
        "unusable_exposure_is_refused",
        misled(lambda obs: replace(obs, exposure_s=np.abs(np.nan_to_num(obs.exposure_s)))),
    ),
    (
        "NaN refused without a name",
        "unusable_exposure_is_refused",
        failing(lambda obs: not np.isfinite(obs.exposure_s).all(), ValueError("bad input")),
    ),
    ("saturation", "very_bright_source_is_survived", changed(lambda obs, f: ranked(f[f["counts"] < 1e5]))),
    ("blind at the border", "sources_at_the_border_are_found", changed(far_from_borders)),
    ("crash in crowds", "crowded_field_is_survived", failing(lambda obs: obs.counts.sum() > 4e5, MemoryError())),
    ("artefacts along masks", "mask_makes_no_sources", changed(along_masks)),
    (
        "no normalisation at masks",
        "mask_makes_no_sources",
        misled(lambda obs: replace(obs, exposure_s=np.full_like(obs.exposure_s, obs.exposure_s.max()))),
    ),
    ("sources inside masks", "mask_makes_no_sources", changed(inside_masks)),
    ("artefacts at the border", "border_makes_no_sources", changed(along_borders)),
    ("blind beside masks", "source_cut_by_a_mask_is_found", changed(far_from_masks)),
    ("crash on small images", "small_images_work_or_are_refused", failing(is_small, IndexError("no ring"))),
    (
        "a profile that fails",
        "every_profile_runs",
        replace(SOUND, profiles={**SOUND.profiles, "mad": SOUND.params(photons_min=1e6)}),
    ),
    (
        "a parameter that drifts",
        "parameters_pass_through_a_campaign",
        replace(SOUND, params=DriftingParams, profiles={"paper": DRIFTING}, tiny=DRIFTING),
    ),
    (
        "a word FITS cannot spell",
        "catalogue_comes_back",
        replace(changed(lambda obs, f: f.assign(shape_word="ωval")), extra_columns=(*SOUND.extra_columns, WORD)),
    ),
    ("no profile paper", "record_is_complete", replace(SOUND, profiles={"modern": SOUND.tiny})),
    ("a native name in capitals only", "record_is_complete", replace(SOUND, native_names={"COUNTS": "counts"})),
)  # fmt: skip
