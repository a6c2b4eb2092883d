"""How the work is cut, what is left alone, and the limits it has."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_campaigns import small

from survey_mc.campaign import expand
from survey_mc.errors import BadInput
from survey_mc.run.gaps import Gaps, known_gaps
from survey_mc.run.order import Cost, Outcome
from survey_mc.run.plan.pace import FIRST_FIELDS, ORDER_SECONDS, Pace, block_size
from survey_mc.run.quarantine.attempts import AttemptNote, Place, deaths, forget
from survey_mc.run.quarantine.limits import FieldLimits, limited_memory
from survey_mc.run.quarantine.suspects import find_suspects
from survey_mc.run.work import orders
from survey_mc.store import Manifest, RunLayout


def spent(seconds: float) -> Outcome:
    return Outcome(costs={("G", "detect"): Cost(1, seconds, seconds)})


@given(st.floats(1e-4, 1e4), st.integers(1, 1000), st.integers(1, 500))
def test_an_order_takes_some_seconds_or_is_one_field_or_one_file(field_s: float, fields: int, most: int) -> None:
    pace = Pace(most)
    pace.book(0, fields, spent(field_s * fields))
    block = pace.block(0)

    assert 1 <= block <= most
    assert block == 1 or block * field_s <= ORDER_SECONDS * (1 + 1e-9)
    assert block == most or (block + 1) * field_s > ORDER_SECONDS * (1 - 1e-9)


def test_of_an_unknown_cell_little_is_ordered_and_a_fixed_number_is_kept() -> None:
    assert Pace(64).block(3) == FIRST_FIELDS
    assert Pace(3).block(3) == 3
    fixed = Pace(64, fixed=True)
    fixed.book(0, 1, spent(1000.0))
    assert fixed.block(0) == 64


@given(st.integers(2, 16), st.integers(1, 3000), st.integers(1, 100))
def test_the_last_orders_are_small_where_that_is_worth_joining_their_files(
    workers: int, n_fields: int, most: int
) -> None:
    for n, commit_s in ((workers, 1e-9), (workers, 1e-6), (1, 1e-9)):
        pace = Pace(most, n_fields=n_fields, workers=n)
        cost = spent(1e-6)
        cost.costs["G", "commit"] = Cost(1, commit_s, commit_s)
        pace.book(0, 1, cost)
        is_worth_it = n > 1 and commit_s < 1e-6
        sizes = []
        while pace.n_left > 0:
            left = pace.n_left
            sizes.append(min(pace.block(0), left))
            pace.hand_out(sizes[-1])
            if is_worth_it:
                assert sizes[-1] <= max(FIRST_FIELDS, left / n)
        assert sum(sizes) == n_fields
        assert is_worth_it or sizes[:-1] == [most] * (len(sizes) - 1)


@given(st.integers(1, 100_000), st.integers(1, 64), st.integers(1, 1000))
def test_every_worker_gets_several_orders(n_fields: int, workers: int, per_file: int) -> None:
    block = block_size(n_fields, workers, per_file)

    assert 1 <= block <= per_file
    assert block == 1 or n_fields // block >= 8 * workers


@given(st.lists(st.integers(1, 9), min_size=1), st.sets(st.integers(0, 10)))
def test_orders_cover_what_is_missing_once_whatever_their_sizes(sizes: list[int], failed: set[int]) -> None:
    campaign = small(("realisations = 6", "realisations = 11"))
    (cell,) = expand(campaign)
    turn = iter(sizes * 11)
    gaps = {cell.methods[0].detect_key: failed}

    found = list(orders(campaign, (cell,), Manifest(Path("none")), Path(), lambda index: next(turn), gaps))

    drawn = [j for order in found for j in range(order.start, order.stop) if order.truth]
    detected = [j for order in found for j in range(order.start, order.stop) if order.detect]
    assert drawn == list(range(11))
    assert detected == [j for j in range(11) if j not in failed]


def test_gaps_are_those_that_the_journals_tell() -> None:
    entries = [
        {"event": "start"},
        {"event": "failure", "key": "a", "realisation": 3},
        {"event": "failure", "key": "", "realisation": 4},
        {"event": "skip", "key": "a", "realisation": 5},
        {"event": "quarantine", "keys": ["a", "b"], "start": 7, "stop": 9},
    ]
    gaps = known_gaps(entries)

    assert gaps == Gaps({"a": {3, 7, 8}, "b": {7, 8}}, {"a": {5}})
    assert gaps.left_alone == {"a": {3, 5, 7, 8}, "b": {7, 8}}


def test_memory_beyond_the_limit_is_a_memory_error_and_the_limit_ends_with_its_block() -> None:
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with limited_memory(FieldLimits(memory_mb=2000)), pytest.raises(MemoryError):
        np.ones(2**29)
    assert resource.getrlimit(resource.RLIMIT_DATA) == before
    with limited_memory(FieldLimits(memory_mb=0)):
        assert resource.getrlimit(resource.RLIMIT_DATA) == before


@pytest.mark.parametrize(("seconds", "memory_mb"), [(0.01, 0), (-1.0, 0), (float("nan"), 0), (600.0, 10), (600.0, -5)])
def test_limits_that_make_no_sense_are_refused(seconds: float, memory_mb: int) -> None:
    with pytest.raises(BadInput, match="must be 0"):
        FieldLimits(seconds, memory_mb)


def dead_at(folder: Path, place: Place) -> None:
    """Leave the note of a process that has died there."""
    script = f"""
import os
from pathlib import Path
from survey_mc.run.quarantine.attempts import AttemptNote, Place
from survey_mc.run.quarantine.limits import FieldLimits
note = AttemptNote(Path({str(folder)!r}), "order", FieldLimits()).__enter__()
note.at({place!r})
os._exit(3)
"""
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 3


def test_a_dead_process_is_suspect_at_the_place_of_its_note_and_a_living_one_is_not(tmp_path: Path) -> None:
    (cell,) = expand(small())
    layout = RunLayout(tmp_path)
    place = Place(cell.methods[0].detect_key, 4, "an older label", "detect")
    dead_at(layout.attempts, place)
    dead_at(layout.attempts, Place("another campaign", 4, "G", "detect"))
    with AttemptNote(layout.attempts, "order", FieldLimits()) as note:
        note.at(Place(cell.field_key, 1, "", "draw"))
        assert sorted(d.place.realisation for d in deaths(layout.attempts, "order") if d.place) == [4, 4]

    ((key, suspects),) = find_suspects(layout, (cell,)).items()
    assert key == cell.field_key
    assert [(s.realisation, s.label, s.timed_out) for s in suspects] == [(4, cell.methods[0].label, False)]
    assert not layout.attempts.exists()


def test_a_finished_order_leaves_no_note(tmp_path: Path) -> None:
    with AttemptNote(tmp_path / "attempts", "order", FieldLimits(seconds=0.5)) as note:
        note.at(Place("key", 0, "G", "detect"))
        note.at(None)
        time.sleep(0.7)  # longer than a place may take: no place has no limit
    assert list((tmp_path / "attempts").iterdir()) == []
    forget(tmp_path / "attempts")
    forget(tmp_path / "attempts")
