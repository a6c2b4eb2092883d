"""Rows as arrays say what the frame says, however they are cut."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stats_frames import match_rows

from survey_mc.stats import Astrometry, CompletenessCounts, NumberCounts, Photometry, StatusCounts
from survey_mc.stats.bins import FLUX_BINS
from survey_mc.stats.match_rows import MatchRows

STATUSES = ("matched", "missed", "spurious", "faint", "outside")


def mixed_rows(n, seed=0):
    rng = np.random.default_rng(seed)
    return match_rows(
        n,
        status=rng.choice(np.array(STATUSES, dtype=object), n),
        kind_true=rng.choice(np.array(["point", "extended", ""], dtype=object), n),
        realisation=np.sort(rng.integers(0, 9, n)),
        flux_true_cgs=10.0 ** rng.uniform(-16, -13, n),
        flux_cgs=10.0 ** rng.uniform(-16, -13, n),
        counts=rng.uniform(0, 300, n),
        counts_onaxis=rng.uniform(0, 300, n),
        counts_expected=rng.uniform(0, 300, n),
        sep_arcsec=rng.rayleigh(2.0, n),
        offaxis_arcmin=rng.uniform(0, 12, n),
    )


@given(st.lists(st.tuples(st.sampled_from(STATUSES), st.booleans(), st.booleans()), max_size=30))
def test_rows_cut_twice_are_the_frame_cut_twice(drawn):
    frame = match_rows(len(drawn), status=np.array([d[0] for d in drawn], dtype=object), det_id=np.arange(len(drawn)))
    first = np.array([d[1] for d in drawn], dtype=bool)
    second = np.array([d[2] for d in drawn], dtype=bool)[first]

    rows = MatchRows.of(frame).where(first).where(second)
    plain = frame[first][second]

    assert len(rows) == len(plain)
    assert rows.integers("det_id").tolist() == plain["det_id"].tolist()
    assert rows.has("status", "matched", "faint").tolist() == plain["status"].isin(["matched", "faint"]).tolist()
    assert not rows.has("status", "unheard of").any()


@pytest.mark.parametrize("dtype", [object, "str", "category"])
def test_a_text_is_the_same_text_however_pandas_keeps_it(dtype):
    frame = mixed_rows(50)
    rows = MatchRows.of(frame.astype({"status": dtype}))
    assert rows.has("status", "missed").tolist() == (frame["status"] == "missed").tolist()


def test_a_missing_text_is_no_status():
    frame = match_rows(3, status=np.array(["matched", None, "missed"], dtype=object))
    assert MatchRows.of(frame).has("status", "matched", "missed", "None", "nan").tolist() == [True, False, True]


SUMS = (Photometry, Astrometry, partial(NumberCounts, 10.0), partial(StatusCounts, 9),
        partial(CompletenessCounts, FLUX_BINS, 9))  # fmt: skip


@pytest.mark.parametrize("make", SUMS)
def test_rows_and_their_frame_give_the_same_sums(make):
    frame = mixed_rows(400)
    of_frame, of_rows = make(), make()
    of_frame.add(frame)
    of_rows.add(MatchRows.of(frame))
    pd.testing.assert_frame_equal(table_of(of_frame), table_of(of_rows))


def table_of(sums):
    if isinstance(sums, NumberCounts):
        return sums.differential(1.0, 1.0)
    if isinstance(sums, StatusCounts):
        return sums.table(9)
    return sums.table(np.random.default_rng(0)) if isinstance(sums, CompletenessCounts) else sums.table()
