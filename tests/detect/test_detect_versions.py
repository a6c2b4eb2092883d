"""A procedure whose answers change must raise its version: it is part of the key of every stored result."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from detect_fields import BACKGROUND_10KS, observe, photon_image

from survey_mc.detect import DETECTORS, check_detections

# (name, version): detections, then the sums of their x (pix), y (pix), counts and significance on the field below.
# When this fails: raise the version of the procedure and put the new answer under the new number.
ANSWERS: dict[tuple[str, int], tuple[int, float, float, float, float]] = {
    ("emldetect", 1): (34, 4243.276, 4122.591, 11758.937, 56355.422),
    ("vtpdetect", 1): (22, 2796.526, 2600.717, 10870.057, 16502.736),
    ("wavdetect", 1): (40, 4814.021, 4468.747, 9770.449, 1377.624),
    ("ewavelet", 1): (36, 4308.303, 4143.206, 7168.336, 860.612),
    ("gauss_se", 2): (31, 3802.772, 3412.778, 10048.963, 4495.906),
    ("mr1_se", 2): (31, 3846.381, 3537.068, 9692.279, 1624.822),
}
# Sum of the stellarity of the detections of the procedures that have it; the shipped network is part of their version.
STELLARITY: dict[tuple[str, int], float] = {("gauss_se", 2): 29.650, ("mr1_se", 2): 30.959}
# A pixel on one side or the other of an isophote, for a rounding.
STELLARITY_TOLERANCE = 0.05
# Sums of 32-bit images differ in the last digits between processors; a changed answer differs by far more.
RELATIVE = 1e-4


def detections(name: str) -> pd.DataFrame:
    """What the profile "paper" finds on a fixed field of points."""
    rng = np.random.default_rng(20010208)
    places = rng.uniform(10.0, 245.0, (30, 2))
    sources = [(x, y, counts) for (x, y), counts in zip(places, np.geomspace(30.0, 1500.0, 30), strict=True)]
    observation = observe(photon_image(rng, BACKGROUND_10KS, sources, 256))
    detector = DETECTORS[name]
    found = detector.detect(observation, detector.profiles["paper"], np.random.default_rng(0))
    return check_detections(detector, observation, found)


def answer(name: str) -> tuple[int, float, float, float, float]:
    """The number of detections and the sums of four columns."""
    frame = detections(name)
    sums = frame[["x_pix", "y_pix", "counts", "significance"]].sum().tolist()
    return len(frame), sums[0], sums[1], sums[2], sums[3]


@pytest.mark.parametrize("detector", DETECTORS.built_in, ids=[detector.name for detector in DETECTORS.built_in])
def test_answers_change_only_with_the_version(detector) -> None:
    key = (detector.name, detector.version)
    assert key in ANSWERS, f"add the answer of {key}: {answer(detector.name)}"
    assert answer(detector.name) == pytest.approx(ANSWERS[key], rel=RELATIVE)


@pytest.mark.parametrize("name", ["gauss_se", "mr1_se"])
def test_stellarity_changes_only_with_the_version(name: str) -> None:
    key = (name, DETECTORS[name].version)
    assert key in STELLARITY
    assert detections(name)["stellarity"].sum() == pytest.approx(STELLARITY[key], abs=STELLARITY_TOLERANCE)
