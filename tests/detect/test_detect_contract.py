"""`check_detections` reads the author his own mistake; the registry and its records."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from detect_fields import observe, photon_image
from pydantic import BaseModel, Field

from survey_mc.columns import DETECTIONS, Column
from survey_mc.detect import (
    DETECTORS,
    DetectorContractError,
    DetectorParams,
    check_detections,
    declared_columns,
    native_columns,
    record_problem,
)
from survey_mc.registry import UnknownName

DETECTOR = DETECTORS["gauss_se"]


@pytest.fixture(scope="module")
def observation():
    return observe(photon_image(np.random.default_rng(1), 0.178, [(60, 50, 300), (90, 100, 200)], n_pix=128))


@pytest.fixture
def frame(observation):
    return DETECTOR.detect(observation, DETECTOR.tiny, np.random.default_rng(0))


def test_good_frame_passes_unchanged(observation, frame):
    checked = check_detections(DETECTOR, observation, frame)
    assert tuple(checked.columns) == tuple(c.name for c in declared_columns(DETECTOR))
    assert tuple(checked.columns[: len(DETECTIONS.names) - 1]) == DETECTIONS.names[1:]
    assert checked.equals(frame)


def test_columns_are_put_in_the_declared_order_and_dtype(observation, frame):
    shuffled = frame[frame.columns[::-1]].astype({"flags": np.int64, "isoarea_pix": np.int64})
    assert check_detections(DETECTOR, observation, shuffled).equals(frame)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda f: f.drop(columns="counts"), "missing counts"),
        (lambda f: f.assign(colour=1.0), "undeclared colour"),
        (lambda f: f.assign(flags=0.5), "column flags must hold int32"),
        (lambda f: f.assign(counts="many"), "column counts must hold float64"),
        (lambda f: f.assign(flags=2**40), "column flags must fit into int32"),
        (lambda f: f.assign(det_id=0), "det_id must count 0"),
        (lambda f: f.assign(det_id=f["det_id"] + 5), "det_id must count 0"),
        (lambda f: f.assign(x_pix=np.nan), "x_pix must be finite"),
        (lambda f: f.assign(y_pix=500.0), "y_pix must lie on the image"),
        (lambda f: f.assign(significance=np.inf), "significance must be finite"),
        (lambda f: f.assign(counts_err=-1.0), "counts_err must be ≥ 0"),
        (lambda f: f.assign(r50_arcsec=np.inf), "r50_arcsec must be ≥ 0"),
        (lambda f: f.to_numpy(), "must return a pandas DataFrame"),
    ],
)
def test_every_mistake_is_a_sentence_with_the_detector_name(observation, frame, change, sentence):
    with pytest.raises(DetectorContractError, match=sentence) as caught:
        check_detections(DETECTOR, observation, change(frame))
    assert f"'gauss_se' version {DETECTOR.version}" in str(caught.value)


def test_nan_is_allowed_where_nothing_is_known(observation, frame):
    unknown = frame.assign(flux_cgs=np.nan, flux_err_cgs=np.nan, x_err_pix=np.nan, r50_arcsec=np.nan)
    assert len(check_detections(DETECTOR, observation, unknown)) == len(frame)


def test_unknown_detector_lists_the_known_ones():
    with pytest.raises(UnknownName, match="did you mean 'mr1_se'"):
        DETECTORS["mr1"]


@pytest.mark.parametrize("detector", DETECTORS.built_in, ids=[d.name for d in DETECTORS.built_in])
def test_every_record_is_complete_with_both_profiles(detector):
    assert record_problem(detector) is None
    assert {"paper", "modern"} <= set(detector.profiles)
    assert dataclasses.is_dataclass(detector)


@pytest.mark.parametrize("detector", DETECTORS.built_in, ids=[d.name for d in DETECTORS.built_in])
def test_every_flag_a_procedure_raises_is_documented(detector):
    rng = np.random.default_rng(15)
    sources = [(x, y, 400.0) for x, y in rng.uniform(2.0, 125.0, (40, 2))]
    image = photon_image(rng, 0.178, sources, n_pix=128)
    raised = np.bitwise_or.reduce(detector.detect(observe(image), detector.tiny, rng)["flags"].to_numpy())
    assert raised & ~sum(detector.flag_bits) == 0


class SilentParams(DetectorParams):
    radius_pix: float = Field(1.0)


class LooseParams(BaseModel):
    radius_pix: float = Field(1.0, description="radius (pixels)")


PROBE = Column("probe_pix", "float64", "something", "pixel")


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"name": "my method"}, "name must be an identifier"),
        ({"version": 0}, "version must count from 1"),
        ({"reference": " "}, "reference must say something"),
        ({"profiles": {}}, "profiles must have 'paper'"),
        ({"tiny": SilentParams()}, "profile 'tiny' must be GaussSeParams .got SilentParams"),
        (
            {"params": SilentParams, "tiny": SilentParams(), "profiles": {"paper": SilentParams()}},
            "needs a description with its unit .missing: radius_pix",
        ),
        (
            {"params": LooseParams, "tiny": LooseParams(), "profiles": {"paper": LooseParams()}},
            "must be frozen and forbid unknown keys",
        ),
        ({"extra_columns": (dataclasses.replace(PROBE, about=""),)}, "probe_pix must say what it means"),
        ({"extra_columns": (dataclasses.replace(PROBE, dtype="float32"),)}, "must be one of .* .got float32"),
        ({"extra_columns": (dataclasses.replace(PROBE, name="my probe"),)}, "must be an identifier"),
        ({"extra_columns": (PROBE, dataclasses.replace(PROBE, name="Probe_Pix"))}, "differ in more than capitals"),
        ({"extra_columns": (dataclasses.replace(PROBE, name="counts"),)}, "counts and counts"),
        ({"extra_columns": (dataclasses.replace(PROBE, name="ra"),)}, "RA and ra"),
        ({"native_names": {"SCTS": "scts"}}, "SCTS must stand for a declared column .got 'scts'"),
        ({"native_names": {"Counts": "counts"}}, "counts and Counts"),
        ({"native_names": {"x_image": "x_pix"}}, "X_IMAGE and x_image"),
        ({"flag_bits": {3: "two bits"}}, "flag_bits must be single bits of an int32 .got 3"),
        ({"flag_bits": {1 << 31: "the sign"}}, "flag_bits must be single bits"),
        ({"flag_bits": {4: ""}}, "what bit 4 means"),
    ],
)
def test_every_mistake_of_a_record_is_a_sentence(changes, sentence):
    assert re.search(sentence, record_problem(dataclasses.replace(DETECTOR, **{"native_names": {}, **changes})) or "")


def test_native_columns_repeat_declared_ones_in_their_unit():
    native = {column.name: (column, same) for column, same in native_columns(DETECTOR)}
    declared = {column.name: column for column in declared_columns(DETECTOR)}
    assert {"FLUX_AUTO", "FLUXERR_AUTO", "A_IMAGE", "B_IMAGE", "THETA_IMAGE", "ISOAREA_IMAGE"} <= set(native)
    for column, same in native.values():
        assert (column.unit, column.ucd, column.dtype) == (
            declared[same].unit,
            declared[same].ucd,
            declared[same].dtype,
        )
