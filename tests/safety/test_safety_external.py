"""A program of others that misbehaves is a failed field with its name and its last words; nothing of it is left."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import wrapped
from command import command
from programs import FAULTS, WORKS, install
from small_campaigns import TEXT

from survey_mc import testing
from survey_mc.campaign import draw_field, expand, parse_campaign
from survey_mc.detect import DETECTORS
from survey_mc.external import ProgramFailed, run_program

PYTHON = [sys.executable, "-S", "-c"]
CAMPAIGN = TEXT.replace("realisations = 6", "realisations = 2").replace("n_pix = 128", "n_pix = 64")
BRIGHTPIX = '\n[[method]]\nname = "brightpix"\nlabel = "B"\nparams = { timeout_s = 0.5, counts_min = 3 }\n'
ROOT = Path(__file__).parents[2]


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of programs that is in PATH, and the detector that looks for `brightpix` there."""
    monkeypatch.setitem(DETECTORS._entries, "brightpix", wrapped.DETECTOR)
    monkeypatch.setenv("PATH", install(tmp_path, WORKS))
    return tmp_path


def alive(word: str) -> list[str]:
    """Command lines of running processes that have a word in their environment or arguments."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes() + (folder / "environ").read_bytes()
            state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if word.encode() in words and state != "Z" and int(folder.name) != os.getpid():
            found.append(f"{folder.name} {words[:200]!r}")
    return found


def test_a_wrapped_program_finds_what_numpy_finds(path: Path) -> None:
    campaign = parse_campaign(CAMPAIGN + BRIGHTPIX)
    field = draw_field(campaign, expand(campaign)[0], 0)

    found = wrapped.detect(field.observation, wrapped.BrightPixParams(counts_min=3), np.random.default_rng(1))

    y, x = np.nonzero(field.observation.counts >= 3)
    assert len(found) > 3
    assert {*zip(found["x_pix"], found["y_pix"], strict=True)} == {*zip(x, y, strict=True)}


def test_a_wrapped_program_keeps_the_promises_of_a_detector(path: Path) -> None:
    claims = [claim for claim in testing.CLAIMS if any(word in claim.name for word in ("empty", "input", "seed"))]

    assert len(claims) >= 3
    testing.check_detector(wrapped.DETECTOR, claims=claims)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.replace(" ", "_"))
def test_a_fault_of_the_program_is_a_failure_of_that_method_alone(path: Path, tmp_path: Path, fault: str) -> None:
    code, sentence = FAULTS[fault]
    install(path, code)
    (tmp_path / "c.toml").write_text(CAMPAIGN.replace("realisations = 2", "realisations = 1") + BRIGHTPIX)
    start = time.monotonic()

    answer = command("run", tmp_path / "c.toml", "--serial", "--no-report", "--out", tmp_path / "run")

    assert time.monotonic() - start < 30.0
    assert answer.code == 3
    (failure,) = json.loads(command("status", tmp_path / "run", "--json").out)["failures"]
    assert failure["method"] == "B"
    assert sentence in failure["error"]
    assert alive(str(tmp_path)) == []


def test_the_program_gets_its_words_as_they_are_and_little_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SECRET_TOKEN", "x")
    words = ["a b", "$HOME", "`id`", ";ls", "*", "", "é", "'\"", "-rf", "a\nb"]
    code = (
        "import os, sys; open('o', 'w').write(repr((sys.argv[1:], sorted(os.environ), os.getcwd(), sys.stdin.read())))"
    )

    result = run_program([*PYTHON, code, *words], files_in={"d/in": b"1"}, wanted=["o"], environment={"PFILES": "p"})

    given, variables, folder, typed = ast_of(result.files["o"])
    assert given == words
    assert "SECRET_TOKEN" not in variables
    assert {"PATH", "HOME", "PFILES", "LC_ALL"} <= set(variables)
    assert typed == ""
    assert not Path(folder).exists()
    assert result.n_left_behind == 0


def ast_of(content: bytes) -> tuple[list[str], list[str], str, str]:
    import ast

    return ast.literal_eval(content.decode())  # type: ignore[no-any-return]


def test_head_and_tail_of_the_output_are_kept() -> None:
    code = "print('first words'); print('x' * 1_000_000); print('last words')"

    result = run_program([*PYTHON, code], log_bytes_max=2000)

    assert result.log.startswith("first words\n")
    assert result.log.endswith("last words\n")
    assert "bytes left out" in result.log
    assert len(result.log) < 2100


OFFSPRING = {
    "daemon without environment": "import os, time\nif os.fork() == 0:\n os.setsid()\n if os.fork() == 0:\n"
    "  os.execve('/bin/sleep', ['sleep', TOKEN], {})\n os._exit(0)\ntime.sleep(0.1)",
    "nine children": "import subprocess\nfor n in range(9): subprocess.Popen(['sleep', TOKEN])",
    "deaf child": "import os, signal, time\nif os.fork() == 0:\n signal.signal(15, signal.SIG_IGN)\n"
    " os.execv('/bin/sleep', ['sleep', TOKEN])\ntime.sleep(0.1)",
}


@pytest.mark.parametrize("code", OFFSPRING.values(), ids=OFFSPRING.keys())
def test_nothing_the_program_started_outlives_it(code: str) -> None:
    token = f"{3600 + os.getpid() / 1e7:.7f}"

    result = run_program([*PYTHON, code.replace("TOKEN", repr(token))])

    assert result.n_left_behind in (1, 9)
    assert alive(token) == []


def test_the_program_ends_when_the_process_that_asked_dies(tmp_path: Path) -> None:
    token = f"{7200 + os.getpid() / 1e7:.7f}"
    code = f"from survey_mc.external import run_program; run_program(['sleep', '{token}'])"
    asking = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}, cwd=tmp_path)
    wait_for(lambda: len(alive(f"sleep\0{token}")) == 1)

    asking.send_signal(signal.SIGKILL)
    asking.wait()

    wait_for(lambda: not alive(token))


def wait_for(happens: object, seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not happens():  # type: ignore[operator]
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_limits_of_memory_and_files_hold(tmp_path: Path) -> None:
    with pytest.raises(ProgramFailed, match="MemoryError"):
        run_program([*PYTHON, "b = b'x' * 10**9"], memory_bytes_max=10**8)
    with pytest.raises(ProgramFailed, match="File too large"):
        run_program([*PYTHON, "open('o', 'wb').truncate(2**40)"], wanted=["o"], file_bytes_max=10**6)


REFUSED = {
    "a shell line": ("ls -l", {}, "must be a list of texts"),
    "nothing": ([], {}, "must be a list of texts"),
    "a program that is not there": (
        ["no_such_program"],
        {},
        "no_such_program: there is no such executable program in PATH",
    ),
    "a path that is not there": (["./no_such"], {}, "there is no such executable program there"),
    "a null character": (["true", "a\0b"], {}, "null character"),
    "a file above": (["true"], {"wanted": ["../x"]}, "lie below it"),
    "an absolute file": (["true"], {"files_in": {"/tmp/x": b""}}, "lie below it"),
    "a pipe as input": (["true"], {"files_in": {"x": Path("/dev/zero")}}, "is not a regular file"),
    "no time at all": (["true"], {"timeout_s": 0.0}, "timeout_s must be"),
    "a time that is none": (["true"], {"timeout_s": float("nan")}, "timeout_s must be"),
}


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case.replace(" ", "_"))
def test_a_bad_call_is_one_sentence(case: str) -> None:
    argv, options, sentence = REFUSED[case]
    with pytest.raises(ProgramFailed, match=sentence):
        run_program(argv, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "what", ["os.mkfifo('o')", "os.mkdir('o')", "os.symlink('/dev/zero', 'o')", "os.symlink('o', 'o')"]
)
def test_only_regular_files_of_the_folder_come_back(what: str) -> None:
    with pytest.raises(ProgramFailed, match="its file o cannot be taken"):
        run_program([*PYTHON, f"import os; {what}"], wanted=["o"])


def test_a_failure_can_be_sent_to_another_process() -> None:
    import pickle

    with pytest.raises(ProgramFailed) as caught:
        run_program([*PYTHON, "print('words'); raise SystemExit(3)"])

    again = pickle.loads(pickle.dumps(caught.value))  # noqa: S301
    assert (str(again), again.status, again.log) == (str(caught.value), 3, "words\n")
