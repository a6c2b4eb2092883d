"""What an observer does: detection procedures, one a file, and the list of them.

Idea     a procedure is registered by one line in `DETECTORS`; its result passes `check_detections`.
Limits   files that begin with an underscore are shared kernels, private to this folder.
"""

from survey_mc.detect import gauss_se, mr1_se
from survey_mc.detect.contract import DetectorContractError, check_detections, declared_columns
from survey_mc.detect.detector import Detector, DetectorParams
from survey_mc.registry import Registry

DETECTORS: Registry[Detector] = Registry("detector", [gauss_se.DETECTOR, mr1_se.DETECTOR])

__all__ = [
    "DETECTORS",
    "Detector",
    "DetectorContractError",
    "DetectorParams",
    "check_detections",
    "declared_columns",
]
