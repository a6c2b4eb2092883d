"""A failing method is its own fault alone: noted with a replay command, never stored, tried again only when asked."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pandas import DataFrame
from small_campaigns import MR1, small

from survey_mc.detect import DETECTORS
from survey_mc.run import open_run, run_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.status.state import run_status
from survey_mc.types import Observation, Skip

SERIAL = ExecutorChoice(serial=True)


class _Sick:
    """gauss_se with an illness on some of the fields it sees, counted by their photons."""

    def __init__(self, healthy: object) -> None:
        self.healthy = healthy
        self.cured = False

    def __call__(self, observation: Observation, params: object, rng: np.random.Generator) -> DataFrame | Skip:
        if not self.cured and int(observation.counts.sum()) % 2:
            raise RuntimeError("the odd photon is too much")
        return self.healthy(observation, params, rng)  # type: ignore[operator,no-any-return]


@pytest.fixture
def sick(monkeypatch: pytest.MonkeyPatch) -> _Sick:
    detector = DETECTORS["gauss_se"]
    illness = _Sick(detector.detect)
    monkeypatch.setitem(DETECTORS._entries, "gauss_se", replace(detector, detect=illness))
    return illness


def test_a_failing_method_leaves_the_other_alone_and_is_retried_when_asked(tmp_path: Path, sick: _Sick) -> None:
    campaign, root = small(extra=MR1), tmp_path / "run"

    first = run_campaign(campaign, root, SERIAL, block=1)
    state = run_status(root)

    assert 0 < first.failed < 6
    assert not first.complete
    assert len(open_run(root).matches("M")["realisation"].unique()) == 6
    assert state.n_failed == first.failed
    assert all("the odd photon" in failure["error"] for failure in state.failures)
    assert all(failure["replay"].startswith("survey-mc replay ") for failure in state.failures)
    assert run_campaign(campaign, root, SERIAL).fields == 0

    sick.cured = True
    retried = run_campaign(campaign, root, SERIAL, retry_failed=True)

    assert retried.fields == first.failed
    assert retried.complete
    assert run_status(root).n_failed == 0


def test_files_around_a_failure_do_not_depend_on_the_block_size(tmp_path: Path, sick: _Sick) -> None:
    found = []
    for block in (1, 4):
        run_campaign(small(), tmp_path / str(block), SERIAL, block=block)
        store = tmp_path / str(block) / "store"
        found.append({str(p.relative_to(store)): p.read_bytes() for p in store.rglob("*.parquet")})

    assert found[0] == found[1]


def test_a_detector_that_breaks_its_contract_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    detector = DETECTORS["gauss_se"]
    broken = replace(detector, detect=lambda obs, params, rng: DataFrame({"x": [1.0]}))
    monkeypatch.setitem(DETECTORS._entries, "gauss_se", broken)

    done = run_campaign(small(), tmp_path / "run", SERIAL)

    assert done.failed == 6
    assert "column" in run_status(tmp_path / "run").failures[0]["error"]


def test_a_skip_is_neither_a_failure_nor_a_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    detector = DETECTORS["gauss_se"]
    monkeypatch.setitem(DETECTORS._entries, "gauss_se", replace(detector, detect=lambda *_: Skip("needs a new moon")))

    done = run_campaign(small(), tmp_path / "run", SERIAL)

    assert done.skipped == 6
    assert done.complete
    assert run_status(tmp_path / "run").skips == {"needs a new moon": 6}
    assert open_run(tmp_path / "run").detections().empty


def test_a_method_that_leaves_the_program_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def leave(*_: object) -> DataFrame:
        raise SystemExit(0)

    monkeypatch.setitem(DETECTORS._entries, "gauss_se", replace(DETECTORS["gauss_se"], detect=leave))

    assert run_campaign(small(), tmp_path / "run", SERIAL).failed == 6


def test_a_field_that_cannot_be_drawn_is_left_alone_until_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ArithmeticError("no such sky")

    with monkeypatch.context() as patch:
        patch.setattr("survey_mc.run.task.draw_field", broken)
        assert run_campaign(small(), tmp_path / "run", SERIAL).failed == 6
    assert run_status(tmp_path / "run").n_failed == 6
    assert run_campaign(small(), tmp_path / "run", SERIAL).fields == 0
    assert run_campaign(small(), tmp_path / "run", SERIAL, retry_failed=True).complete
    assert run_status(tmp_path / "run").n_failed == 0


def test_a_replay_command_is_safe_to_paste(tmp_path: Path, sick: _Sick) -> None:
    run_campaign(small(('"G"', '"$(touch x)"')), tmp_path / "a run", SERIAL)
    command = run_status(tmp_path / "a run").failures[0]["replay"]

    words = shlex.split(command)
    assert words[2] == str(tmp_path / "a run")
    assert words[-1] == "$(touch x)"
    assert "'$(touch x)'" in command


def test_a_run_without_rows_opens_as_empty_frames_with_their_columns(tmp_path: Path) -> None:
    from survey_mc.campaign import parse_campaign
    from survey_mc.run.engine import write_campaign
    from survey_mc.store import RunLayout

    smoke = Path(__file__).parents[2] / "campaigns" / "smoke.toml"
    write_campaign(parse_campaign(smoke.read_text(encoding="utf-8")), RunLayout(tmp_path))
    opened = open_run(tmp_path)
    for frame in (opened.truth(), opened.detections(), opened.matches(rule="origin"), opened.links()):
        assert frame.empty
        assert {"cell", "realisation"} <= set(frame.columns)
