"""A procedure that crashes, hangs or eats all memory loses the field it did it on, and nothing else is lost."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from faulty_detector import METHOD, environment, install_faulty, journal_events, plant
from small_campaigns import TEXT, small

from survey_mc.run import open_run
from survey_mc.run.status.state import run_status
from survey_mc.store import Manifest, RunLayout

COMMAND = [sys.executable, "-c", "from survey_mc.cli import main; main()"]
FAULTS = {
    1: "segfault",
    3: "exit",
    4: "loop",
    6: "memory",
    8: "exception",
    9: "sys.exit",
    11: "lock",
    12: "interrupt",
}
CAUSES = {
    "segfault": ("crash", "SIGSEGV"),
    "exit": ("crash", "Exit 7"),
    "loop": ("timeout", "Timeout"),
    "lock": ("timeout", "Timeout"),
    "memory": ("memory", "MemoryError"),
    "exception": ("exception", "ZeroDivisionError"),
    "sys.exit": ("exception", "SystemExit"),
    "interrupt": ("exception", "GeneratorExit"),
}
GROWN = ("realisations = 6", "realisations = 16")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("package")
    install_faulty(folder)
    plant(folder, small(GROWN), FAULTS)
    (folder / "small.toml").write_text(TEXT.replace(*GROWN) + METHOD)
    return folder


def run(package: Path, root: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, "run", str(package / "small.toml"), "--out", str(root), "--no-report", *options]
    return subprocess.run(command, env=environment(package), capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture(scope="module")
def finished(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("run") / "a run"
    done = run(package, root, "--workers", "2", "--block", "4", "--field-timeout", "2")
    assert done.returncode == 3, done.stderr
    assert "8 (field, method) pairs in quarantine (2 crash, 3 exception, 1 memory, 2 timeout)" in done.stdout
    return root


def test_exactly_the_guilty_fields_are_in_quarantine_with_their_causes(finished: Path) -> None:
    found = {failure["realisation"]: failure for failure in run_status(finished).failures}

    assert {j: (f["cause"], str(f["error"])[: len(CAUSES[FAULTS[j]][1])]) for j, f in found.items()} == {
        j: CAUSES[kind] for j, kind in FAULTS.items()
    }
    assert all(f["method"] == "F" for f in found.values())


def test_the_journal_tells_where_a_crash_and_a_hang_were(finished: Path) -> None:
    traces = {entry["realisation"]: str(entry["trace"]) for entry in journal_events(finished, "failure")}

    assert "Segmentation fault" in traces[1]
    assert "in detect" in traces[1]
    assert "in endless_python" in traces[4]
    assert "in endless_compiled" in traces[11]


def test_everything_else_is_done(finished: Path) -> None:
    manifest = Manifest(RunLayout(finished).manifest)
    cell = open_run(finished).data.cells[0]

    assert manifest.n_realisations("truth", cell.field_key, 16) == 16
    assert manifest.n_realisations("matches", cell.match_keys["G"], 16) == 16
    assert manifest.n_realisations("matches", cell.match_keys["F"], 16) == 16 - len(FAULTS)
    assert not RunLayout(finished).attempts.exists()


def test_the_replay_command_shows_the_failure(finished: Path, package: Path) -> None:
    failure = next(f for f in run_status(finished).failures if f["realisation"] == 8)
    words = shlex.split(str(failure["replay"]))

    shown = subprocess.run(
        [*COMMAND, *words[1:]], env=environment(package), capture_output=True, text=True, check=False
    )

    assert words[0] == "survey-mc"
    assert "ZeroDivisionError" in shown.stderr


def test_what_is_in_quarantine_is_left_alone_until_asked_for(finished: Path, package: Path) -> None:
    again = run(package, finished, "--serial")
    assert "0 fields done; 8 (field, method) pairs in quarantine" in again.stdout

    (package / "faults.json").write_text("{}")
    retried = run(package, finished, "--serial", "--retry-failed")
    assert retried.returncode == 0, retried.stderr
    assert "8 fields done; 0 (field, method) pairs in quarantine" in retried.stdout
    assert run_status(finished).n_failed == 0


def test_without_workers_a_crash_ends_the_run_and_the_next_one_goes_on(package: Path, tmp_path: Path) -> None:
    plant(package, small(GROWN), {2: "segfault", 5: "loop"})

    first = run(package, tmp_path / "run", "--serial", "--field-timeout", "1")
    second = run(package, tmp_path / "run", "--serial", "--field-timeout", "1")

    assert first.returncode == -11
    assert second.returncode == 3
    causes = {f["realisation"]: f["cause"] for f in run_status(tmp_path / "run").failures}
    assert causes == {2: "crash", 5: "timeout"}
