"""What an observer does: detection procedures, one a file, and the list of them.

Idea     a procedure is registered by one line in `DETECTORS`; its result passes `check_detections`. Other installed
         packages bring theirs through the entry-point group `survey_mc.detectors`; `detections_frame` is the common
         end of a procedure and `observed_pixels` its usual beginning.
Limits   files that begin with an underscore are shared kernels, private to this folder.
"""

from survey_mc.detect import emldetect, ewavelet, gauss_se, mr1_se, vtpdetect, wavdetect
from survey_mc.detect._shared.observed import granted_background, observed_pixels
from survey_mc.detect._shared.rows import detections_frame
from survey_mc.detect.contract import (
    DetectorContractError,
    check_detections,
    declared_columns,
    native_columns,
    record_problem,
    with_native_names,
)
from survey_mc.detect.detector import Detector, DetectorParams, ExtentStatistic
from survey_mc.plugins import Plugins
from survey_mc.registry import Registry

DETECTORS: Registry[Detector] = Registry(
    "detector",
    [
        emldetect.DETECTOR,
        vtpdetect.DETECTOR,
        wavdetect.DETECTOR,
        ewavelet.DETECTOR,
        gauss_se.DETECTOR,
        mr1_se.DETECTOR,
    ],
    plugins=Plugins("survey_mc.detectors", "detector", Detector, record_problem),
)

__all__ = [
    "DETECTORS",
    "Detector",
    "DetectorContractError",
    "DetectorParams",
    "ExtentStatistic",
    "check_detections",
    "declared_columns",
    "detections_frame",
    "granted_background",
    "native_columns",
    "observed_pixels",
    "record_problem",
    "with_native_names",
]
