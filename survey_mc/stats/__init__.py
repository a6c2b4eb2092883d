"""From matches to numbers: sums that stream over pieces, divisions and intervals at the end."""

from survey_mc.stats.astrometry import Astrometry
from survey_mc.stats.completeness import CompletenessCounts, Limit
from survey_mc.stats.false_detections import StatusCounts
from survey_mc.stats.number_counts import NumberCounts
from survey_mc.stats.photometry import Photometry

__all__ = ["Astrometry", "CompletenessCounts", "Limit", "NumberCounts", "Photometry", "StatusCounts"]
