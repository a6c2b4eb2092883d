"""`check_detections` reads the author his own mistake; the registry and its records."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from detect_fields import observe, photon_image

from survey_mc.columns import DETECTIONS
from survey_mc.detect import DETECTORS, DetectorContractError, check_detections, declared_columns
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
    assert "'gauss_se' version 1" in str(caught.value)


def test_nan_is_allowed_where_nothing_is_known(observation, frame):
    unknown = frame.assign(flux_cgs=np.nan, flux_err_cgs=np.nan, x_err_pix=np.nan, r50_arcsec=np.nan)
    assert len(check_detections(DETECTOR, observation, unknown)) == len(frame)


def test_unknown_detector_lists_the_known_ones():
    with pytest.raises(UnknownName, match="did you mean 'mr1_se'"):
        DETECTORS["mr1"]


@pytest.mark.parametrize("detector", DETECTORS, ids=DETECTORS.names)
def test_every_parameter_and_column_is_described(detector):
    assert detector.params.model_config["extra"] == "forbid"
    assert all(field.description for field in detector.params.model_fields.values())
    names = [c.name for c in declared_columns(detector)]
    assert len(set(names)) == len(names)
    assert all(c.about for c in declared_columns(detector))


@pytest.mark.parametrize("detector", DETECTORS, ids=DETECTORS.names)
def test_every_flag_a_procedure_raises_is_documented(detector):
    rng = np.random.default_rng(15)
    sources = [(x, y, 400.0) for x, y in rng.uniform(2.0, 125.0, (40, 2))]
    image = photon_image(rng, 0.178, sources, n_pix=128)
    raised = np.bitwise_or.reduce(detector.detect(observe(image), detector.tiny, rng)["flags"].to_numpy())
    known = sum(detector.flag_bits)
    assert raised != 0
    assert raised & ~known == 0
    assert all(bit.bit_count() == 1 and meaning for bit, meaning in detector.flag_bits.items())


@pytest.mark.parametrize("detector", DETECTORS, ids=DETECTORS.names)
def test_profiles_are_parameters_of_the_procedure(detector):
    assert {"paper", "modern"} <= set(detector.profiles)
    assert all(isinstance(p, detector.params) for p in (*detector.profiles.values(), detector.tiny))
    assert dataclasses.is_dataclass(detector)
