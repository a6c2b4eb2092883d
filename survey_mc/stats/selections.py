"""The subsets of matched sources for which photometry and astrometry are given.

Idea     bins of true flux, bins of input counts, and a few named subsets that the paper quotes.
Source   Valtchanov et al. 2001, Sect. 6.2 (more than 100 counts) and 6.3 (above 50 counts).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.bins import FLUX_BINS, INPUT_COUNTS_BINS

if TYPE_CHECKING:
    from pandas import DataFrame

BRIGHT_COUNTS = (50.0, 100.0)  # Sect. 6.3 and 6.2
NAMED = ("all", "counts_onaxis > 50", "counts_onaxis > 100")
ABOVE_LIMIT = "flux above the 90 % limit"


def matched_rows(matches: DataFrame) -> DataFrame:
    """The matched rows of one rule."""
    return matches[matches["status"].to_numpy(object) == "matched"]


def flux_group(matched: DataFrame) -> NDArray[np.int64]:
    """Flux bin of each row (the last group is the overflow)."""
    return FLUX_BINS.index(matched["flux_true_cgs"].to_numpy(np.float64))


def counts_group(matched: DataFrame) -> NDArray[np.int64]:
    """Input-count bin of each row."""
    return INPUT_COUNTS_BINS.index(matched["counts_onaxis"].to_numpy(np.float64))


def named_groups(matched: DataFrame) -> tuple[NDArray[np.bool_], ...]:
    """Whether each row belongs to each of `NAMED`."""
    counts = matched["counts_onaxis"].to_numpy(np.float64)
    bright = tuple(counts > limit for limit in BRIGHT_COUNTS)
    return (np.ones(len(matched), dtype=bool), *bright)
