"""The subsets of matched sources for which photometry and astrometry are given.

Idea     bins of true flux, bins of input counts, and a few named subsets that the paper quotes.
Source   Valtchanov et al. 2001, Sect. 6.2 (more than 100 counts) and 6.3 (above 50 counts).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.stats.bins import FLUX_BINS, INPUT_COUNTS_BINS
from survey_mc.stats.match_rows import MatchRows

BRIGHT_COUNTS = (50.0, 100.0)  # Sect. 6.3 and 6.2
NAMED = ("all", "counts_onaxis > 50", "counts_onaxis > 100")
ABOVE_LIMIT = "flux above the 90 % limit"
# The last group of each kind of bins is the overflow.
FLUX_GROUPS = range(FLUX_BINS.size + 1)
COUNTS_GROUPS = range(FLUX_GROUPS.stop, FLUX_GROUPS.stop + INPUT_COUNTS_BINS.size + 1)
NAMED_GROUPS = range(COUNTS_GROUPS.stop, COUNTS_GROUPS.stop + len(NAMED))


@dataclass(frozen=True, slots=True)
class Selections:
    """To which subsets matched rows belong: the row and the group of every membership, rows in order in each group.

    Groups are numbered through: `FLUX_GROUPS`, then `COUNTS_GROUPS`, then `NAMED_GROUPS`.
    """

    row: NDArray[np.int64]
    group: NDArray[np.int64]


def selections(matched: MatchRows) -> Selections:
    """The memberships of matched rows; a value below the first bin is in none."""
    counts_onaxis = matched.numbers("counts_onaxis")
    flux_place = FLUX_BINS.index(matched.numbers("flux_true_cgs"))
    counts_place = INPUT_COUNTS_BINS.index(counts_onaxis)
    memberships = [
        (flux_place >= 0, FLUX_GROUPS.start + flux_place),
        (counts_place >= 0, COUNTS_GROUPS.start + counts_place),
        (np.ones(len(matched), dtype=bool), np.full(len(matched), NAMED_GROUPS.start)),
        *((counts_onaxis > lowest, np.full(len(matched), NAMED_GROUPS.start + number))
          for number, lowest in enumerate(BRIGHT_COUNTS, start=1)),
    ]  # fmt: skip
    return Selections(
        np.concatenate([np.flatnonzero(belongs) for belongs, _ in memberships]),
        np.concatenate([group[belongs] for belongs, group in memberships]),
    )
