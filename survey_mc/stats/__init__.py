"""Statistics of a survey: from what was found to fractions, limits and rates, each with its intervals.

Everything works on plain numpy arrays (or on frames with the columns of `columns.MATCHES`) and needs no run. Streaming
sums take a run piece by piece; divisions and intervals come last.

    intervals        binomial (jeffreys, clopper_pearson, wilson) and Poisson (garwood)
    resampling       intervals from resampled fields, design effect
    completeness     completeness in bins and its 50, 80 and 90 % limits
    classification   point against extended: confusion, contamination against completeness, AUC
    photometry, astrometry, number_counts, false_detections   sums over matches
"""

from survey_mc.stats.astrometry import Astrometry
from survey_mc.stats.bins import COUNTS_BINS, FLUX_BINS, INPUT_COUNTS_BINS, LogBins
from survey_mc.stats.classification import (
    PAPER_CUT,
    TRUE_CLASSES,
    JointCut,
    Rate,
    auc,
    auc_interval_fields,
    called_extended,
    classification_rates,
    confusion_by_field,
    contamination_curve,
)
from survey_mc.stats.completeness import CompletenessCounts, Limit
from survey_mc.stats.extent_sums import ExtentSums
from survey_mc.stats.false_detections import StatusCounts
from survey_mc.stats.histograms import Histograms
from survey_mc.stats.intervals import CLAIM, ONE_SIGMA, clopper_pearson, garwood, jeffreys, wilson
from survey_mc.stats.number_counts import NumberCounts
from survey_mc.stats.photometry import Photometry
from survey_mc.stats.resampling import design_effect, field_weights, fraction_interval_fields

__all__ = [
    "CLAIM",
    "COUNTS_BINS",
    "FLUX_BINS",
    "INPUT_COUNTS_BINS",
    "ONE_SIGMA",
    "PAPER_CUT",
    "TRUE_CLASSES",
    "Astrometry",
    "CompletenessCounts",
    "ExtentSums",
    "Histograms",
    "JointCut",
    "Limit",
    "LogBins",
    "NumberCounts",
    "Photometry",
    "Rate",
    "StatusCounts",
    "auc",
    "auc_interval_fields",
    "called_extended",
    "classification_rates",
    "clopper_pearson",
    "confusion_by_field",
    "contamination_curve",
    "design_effect",
    "field_weights",
    "fraction_interval_fields",
    "garwood",
    "jeffreys",
    "wilson",
]
