"""Behaviour that every procedure must show, whatever it does inside: the claims of the conformance kit.

Bounds are the kit's, or narrower ones for procedures that are better than it asks; a wider one needs a reason here.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from detect_fields import BACKGROUND_10KS, grid_positions, observe, photon_image

from survey_mc import testing
from survey_mc.detect import DETECTORS, Detector, check_detections

# Isophotal barycentres: 16 sources of 2000 photons know the mean to 0.02 pixels, and whole background meshes and
# quarter turns change nothing but rounding.
ISOPHOTAL = testing.Tolerances(
    bias_pix=0.08, same_pix=0.15, same_errors=0.0, same_counts=0.05, single_photon_rows=0, counts_ratio=(0.7, 1.05)
)
TOLERANCES = {"gauss_se": ISOPHOTAL, "mr1_se": ISOPHOTAL}

every_procedure = pytest.mark.parametrize(
    "detector", DETECTORS.built_in, ids=[detector.name for detector in DETECTORS.built_in]
)


@cache
def case_of(name: str) -> testing.Case:
    """The trial of a procedure; fields and answers that several claims look at are made once."""
    detector = DETECTORS[name]
    return testing.Case(detector, detector.profiles["paper"], TOLERANCES.get(name, testing.usual_tolerances(name)))


@every_procedure
@pytest.mark.parametrize("claim", testing.CLAIMS, ids=str)
def test_procedure_keeps(detector: Detector, claim: testing.Claim) -> None:
    try:
        claim(case_of(detector.name))
    except testing.NotApplicable as reason:
        pytest.skip(str(reason))


@every_procedure
def test_granted_background_is_used_or_asked_for(detector: Detector) -> None:
    paper = detector.profiles["paper"].model_dump()
    params = detector.params.model_validate({**paper, "background": "granted"})
    positions = grid_positions(4, 256, np.random.default_rng(21))
    image = photon_image(np.random.default_rng(22), BACKGROUND_10KS, [(x, y, 400.0) for x, y in positions], 256)
    observation = observe(image)
    with pytest.raises(ValueError, match="needs an observation with a background map"):
        detector.detect(observation, params, np.random.default_rng(0))
    granted = replace(observation, background=np.full((256, 256), BACKGROUND_10KS))
    frame = check_detections(detector, granted, detector.detect(granted, params, np.random.default_rng(0)))
    assert len(frame) >= 16
    # Fits count the wings of brighter sources as background of the fainter ones: more than granted, never less.
    used = frame["background_per_pix"] / BACKGROUND_10KS
    assert used.median() == pytest.approx(1.0, rel=1e-5)
    assert used.min() > 1.0 - 1e-5
