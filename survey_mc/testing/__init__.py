"""Conformance kit: the claims that every detection procedure must keep, ours and anyone's.

Idea     `check_detector(DETECTOR)` tries all of them in a few seconds and says which are broken; `CLAIMS` can be given
         to `pytest.mark.parametrize`. Nothing here needs pytest.
Limits   it tells whether a procedure is sound, not whether it is good: completeness and false detections are what
         campaigns are for.
"""

from survey_mc.testing.case import Case
from survey_mc.testing.check import (
    CLAIMS,
    Conformance,
    ConformanceError,
    Verdict,
    check_detector,
    claims,
    conformance_of,
)
from survey_mc.testing.claim import Claim, NotApplicable, Violation
from survey_mc.testing.tolerances import Tolerances, usual_tolerances

__all__ = [
    "CLAIMS",
    "Case",
    "Claim",
    "Conformance",
    "ConformanceError",
    "NotApplicable",
    "Tolerances",
    "Verdict",
    "Violation",
    "check_detector",
    "claims",
    "conformance_of",
    "usual_tolerances",
]
