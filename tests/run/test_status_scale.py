"""Status of a run: what its manifest and journals say, whatever their length. No field is computed here."""

from __future__ import annotations

import json
import os
import socket
import tracemalloc
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from small_campaigns import MR1, small

from survey_mc.campaign import Campaign, Cell, expand
from survey_mc.run import open_run
from survey_mc.run.engine import write_campaign
from survey_mc.run.status.digest import LatestStart
from survey_mc.run.status.state import RunStatus, run_status
from survey_mc.store import Family, Manifest, Piece, Record, RunLayout, run_lock
from survey_mc.store.journal_lines import seal_line

CAMPAIGN = small(("realisations = 6", "realisations = 1000"), extra=MR1)
(CELL,) = expand(CAMPAIGN)
KEYS = {method.label: method.detect_key for method in CELL.methods}
NOW = datetime.now(UTC)


def run_dir(root: Path, *entries: dict[str, Any], campaign: Campaign = CAMPAIGN, done: range = range(0)) -> Path:
    """A run directory with a journal, whose matches of all methods are stored for some realisations, ten a file."""
    layout = RunLayout(root)
    layout.journals.mkdir(parents=True)
    write_campaign(campaign, layout)
    (layout.journals / "20260101T000000.000000Z-1.jsonl").write_text("".join(seal_line(entry) for entry in entries))
    matches = (Family("matches", m.match_key) for cell in expand(campaign) for m in cell.methods)
    Manifest(layout.manifest).add(
        Record(Piece(family, start, start + 10), "0" * 64, 1, 1, 1)
        for family in matches
        for start in range(done.start, done.stop, 10)
    )
    return root


def ago(seconds: float) -> str:
    return (NOW - timedelta(seconds=seconds)).isoformat()


def start(seconds_ago: float = 100.0, fields: int = 1000) -> dict[str, Any]:
    return {"event": "start", "run": "r", "at": ago(seconds_ago), "executor": "dask local cluster", "workers": 2,
            "fields": fields}  # fmt: skip


def task(first: int, stop: int, cpu_s: float = 1.0, seconds_ago: float = 0.0, cell: Cell = CELL) -> dict[str, Any]:
    costs = [{"method": m, "stage": s, "fields": stop - first, "cpu_s": cpu_s, "wall_s": cpu_s}
             for m, s in (("", "draw"), ("G", "detect"), ("G", "match"), ("M", "detect"))]  # fmt: skip
    return {"event": "task", "run": "r", "at": ago(seconds_ago), "cell": cell.label, "start": first, "stop": stop,
            "costs": costs}  # fmt: skip


def failure(realisation: int, method: str = "G", **others: Any) -> dict[str, Any]:
    key = KEYS[method] if method else CELL.field_key
    return {"event": "failure", "cell": CELL.label, "realisation": realisation, "method": method, "key": key,
            "stage": "detect", "cause": "exception", "error": f"E{realisation}", "trace": "T" * 2000,
            "replay": f"replay {realisation}", **others}  # fmt: skip


def failed(state: RunStatus) -> list[tuple[str, int]]:
    return [(found["method"], found["realisation"]) for found in state.failures]


def test_a_failure_counts_as_long_as_its_field_is_missing(tmp_path: Path) -> None:
    entries = [failure(5), failure(95), failure(99, "M"), failure(100), failure(2000), failure(101, key="of others")]
    state = run_status(run_dir(tmp_path / "run", *entries, done=range(0, 90)))
    assert failed(state) == [("G", 95), ("M", 99), ("G", 100)]
    assert state.done == 180
    assert "trace" not in state.failures[0]


def test_a_field_that_cannot_be_drawn_is_missing_for_every_method(tmp_path: Path) -> None:
    state = run_status(run_dir(tmp_path / "run", failure(7, "")))
    assert failed(state) == [("G", 7), ("M", 7)]


def test_a_quarantined_task_is_a_failure_of_each_of_its_fields(tmp_path: Path) -> None:
    entry = {"event": "quarantine", "at": ago(0), "cell": CELL.label, "start": 10, "stop": 13, "keys": [KEYS["M"]],
             "cause": "crash", "error": "died", "replay": "replay 10"}  # fmt: skip
    state = run_status(run_dir(tmp_path / "run", entry))
    assert failed(state) == [("M", 10), ("M", 11), ("M", 12)]
    assert {found["cause"] for found in state.failures} == {"crash"}


def test_the_latest_word_on_a_field_holds(tmp_path: Path) -> None:
    def skip(realisation: int) -> dict[str, Any]:
        return {"event": "skip", "cell": CELL.label, "realisation": realisation, "method": "G", "key": KEYS["G"],
                "reason": "needs a new moon"}  # fmt: skip

    again = failure(3, error="again", cause="timeout")
    entries = [failure(3), failure(4), skip(5), skip(6), start(), again, skip(4), failure(5)]
    state = run_status(run_dir(tmp_path / "run", *entries))
    assert failed(state) == [("G", 3), ("G", 5)]
    assert (state.failures[0]["error"], state.failures[0]["cause"]) == ("again", "timeout")
    assert state.skips == {"needs a new moon": 2}  # a new start forgets none of them


def test_the_first_failure_of_each_method_tells_how_many_there_are(tmp_path: Path) -> None:
    entries = [failure(8), failure(9, "M", cause="memory"), *(failure(n) for n in range(20, 520))]
    firsts = run_status(run_dir(tmp_path / "run", *entries)).first_failures
    assert [(f["method"], f["realisation"], f["n"], f["cause"], f["replay"]) for f in firsts] == [
        ("G", 8, 501, "exception", "replay 8"),
        ("M", 9, 1, "memory", "replay 9"),
    ]


def test_seconds_by_procedure_are_those_of_the_journal_table(tmp_path: Path) -> None:
    root = run_dir(tmp_path / "run", start(), task(0, 10, 1.5), task(10, 20, 2.5), start(), task(20, 30))
    state, table = run_status(root), open_run(root).journal()
    assert state.cpu_s == {"": 5.0, "G": 10.0, "M": 5.0}
    assert table.groupby("method")["cpu_s"].sum().to_dict() == state.cpu_s
    assert state.costs["G", "match"].fields == 30
    assert json.loads(json.dumps(state.as_dict()))["cpu_s"] == state.cpu_s


def test_a_run_that_goes_on_tells_its_rate_and_when_it_ends(tmp_path: Path) -> None:
    root = run_dir(tmp_path / "run", start(5e4), task(0, 1), start(100), task(0, 200, 1.0, 60), task(200, 400, 1.0, 20))
    with run_lock(RunLayout(root)):
        last = run_status(root).last_run
    assert last.at_work == f"process {os.getpid()} on {socket.gethostname()}"
    assert (last.done, last.fields, last.workers) == (400, 1000, 2)
    assert last.fields_per_s == pytest.approx(400 / 80)
    assert last.left_s is not None
    assert 0.0 <= last.left_s <= 100.0
    after = run_status(root).last_run
    assert (after.at_work, after.left_s, after.is_over) == ("", None, False)


def test_the_end_is_foreseen_at_the_rate_so_far() -> None:
    latest = LatestStart(ago(100), "serial", 1, 1000, ago(20), done=400)
    assert latest.left_s(NOW) == pytest.approx(600 / 5 - 20)
    assert latest.left_s(NOW + timedelta(hours=1)) == 0.0
    latest.latest_at = ago(200)  # a clock was put back
    assert (latest.elapsed_s, latest.fields_per_s, latest.left_s(NOW)) == (0.0, None, None)


def test_what_a_killed_process_left_in_the_lock_is_nobody_at_work(tmp_path: Path) -> None:
    root = run_dir(tmp_path / "run", start(), task(0, 10))
    for pid in (os.getpid(), 2**22 + 1):  # alive without the lock, and dead
        (root / ".lock").write_text(json.dumps({"pid": pid, "host": socket.gethostname()}))
        assert run_status(root).last_run.at_work == ""
    (root / ".lock").write_text(json.dumps({"pid": 17, "host": "another"}))
    assert run_status(root).last_run.at_work == "process 17 on another (as its lock file says)"
    (root / ".lock").write_text("no JSON")
    assert run_status(root).last_run.at_work == ""


def test_a_run_that_has_ended_says_so(tmp_path: Path) -> None:
    finish = {"event": "finish", "run": "r", "at": ago(1), "wall_s": 9.0}
    last = run_status(run_dir(tmp_path / "run", start(10), task(0, 1000, 1.0, 2), finish)).last_run
    assert (last.is_over, last.done, last.fields_per_s) == (True, 1000, pytest.approx(1000 / 9))
    never = run_status(run_dir(tmp_path / "new")).last_run
    assert (never.fields, never.fields_per_s, never.at_work) == (0, None, "")


def test_memory_of_a_status_does_not_grow_with_its_journal(tmp_path: Path) -> None:
    def peak(root: Path) -> int:
        tracemalloc.start()
        try:
            run_status(root)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    few = run_dir(tmp_path / "few", start(), *(task(n, n + 1) for n in range(50)))
    many = run_dir(tmp_path / "many", start(), *(task(n % 1000, n % 1000 + 1) for n in range(5000)))
    peak(few)
    assert peak(many) - peak(few) < 100_000  # the longer journal has 2.5 MB
