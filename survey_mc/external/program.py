"""A program of others on files of ours: SExtractor, wavdetect, or a script.

Idea     no shell; a private folder that vanishes, with the input files in it; an input that is closed; output that is
         read to the end and kept in part; a time limit; an environment of a few variables; and a guard process that
         ends whatever the program started. Only files in that folder come back, each up to a size.
Limits   this stops accidents, not attacks. The program runs as you: it can read and write what you can, use the
         network, and fill the disk with many files; a container prevents that. Memory is limited if asked for, for
         each process by itself.
"""

from __future__ import annotations

import json
import os
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from survey_mc.errors import SurveyError
from survey_mc.external import guard
from survey_mc.external.capped_log import CappedLog
from survey_mc.files import open_regular, read_regular

TIMEOUT_S = 600.0
TIMEOUT_MAX_S = 1e7
LOG_BYTES_MAX = 65_536
FILE_BYTES_MAX = 2**29
GUARD_S = guard.POLITE_S + guard.END_S + 10.0  # what the guard may take beyond the time limit
KEPT_VARIABLES = ("PATH", "LD_LIBRARY_PATH")
FIXED_VARIABLES = {"LC_ALL": "C.UTF-8", "TZ": "UTC", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


class ProgramFailed(SurveyError):
    """A program that could not be started, did not end well, or left no file where one was wanted.

    status: its exit code, minus the number of the signal that ended it, None if it did not start or ran out of time.
    log: what it printed, as in `ProgramResult`.
    """

    def __init__(self, sentence: str, status: int | None = None, log: str = "") -> None:
        super().__init__(sentence)
        self.status = status
        self.log = log


@dataclass(frozen=True, slots=True)
class ProgramResult:
    """files: content of the wanted files by name, and of the optional ones that are there. log: first and last part of
    what the program printed on both outputs. seconds: of wall time. n_left_behind: processes that it had started and
    that were ended after it."""

    files: Mapping[str, bytes]
    log: str
    seconds: float
    n_left_behind: int


def run_program(
    argv: Sequence[str],
    *,
    files_in: Mapping[str, bytes | Path] | None = None,
    wanted: Sequence[str] = (),
    optional: Sequence[str] = (),
    timeout_s: float = TIMEOUT_S,
    log_bytes_max: int = LOG_BYTES_MAX,
    file_bytes_max: int = FILE_BYTES_MAX,
    memory_bytes_max: int | None = None,
    environment: Mapping[str, str] | None = None,
) -> ProgramResult:
    """Run a program in a private folder and return the files it wrote there; raises `ProgramFailed`.

    argv: the program, a name in PATH or a path, and its arguments, which reach it as they are. files_in: what it finds
    in its working folder, by name: bytes, or a path to copy. wanted: names of files it must leave there; optional: it
    may. timeout_s: of wall time. file_bytes_max: of each file it writes. memory_bytes_max: of the address space of each
    process. environment: more variables (SAS_CCF, PFILES …); it gets PATH, LD_LIBRARY_PATH and a home of its own.
    """
    words = _checked_argv(argv)
    if not 0.0 < timeout_s <= TIMEOUT_MAX_S:
        raise ProgramFailed(
            f"{words[0]}: timeout_s must be more than 0 and at most {TIMEOUT_MAX_S:g} (got {timeout_s})"
        )
    for name in (*(files_in or {}), *wanted, *optional):
        _refuse_elsewhere(words[0], name)
    with tempfile.TemporaryDirectory(prefix="survey_mc-", ignore_cleanup_errors=True) as folder:
        _put(Path(folder), words[0], files_in or {})
        order = {
            "program": _found(words[0], environment or {}),
            "argv": words,
            "folder": folder,
            "environment": _environment(folder, environment or {}),
            "timeout_s": float(timeout_s),
            "file_bytes_max": file_bytes_max,
            "memory_bytes_max": memory_bytes_max,
        }
        start = time.monotonic()
        answer, log = _guarded(order, log_bytes_max)
        seconds = time.monotonic() - start
        _refuse_bad_end(words[0], answer, log, timeout_s)
        files = _taken(Path(folder), words[0], wanted, optional, file_bytes_max, log)
    return ProgramResult(files, log.text(), seconds, int(answer["left"]))


def _checked_argv(argv: Sequence[str]) -> list[str]:
    if isinstance(argv, str | bytes) or not argv or not all(isinstance(word, str) for word in argv):
        raise ProgramFailed(f"argv must be a list of texts, the program first; there is no shell (got {argv!r:.60})")
    if any("\0" in word for word in argv):
        raise ProgramFailed(f"{argv[0]!r:.60}: an argument must not hold a null character")
    return list(argv)


def _refuse_elsewhere(program: str, name: str) -> None:
    path = PurePosixPath(name)
    if not path.name or path.is_absolute() or ".." in path.parts or "\0" in name:
        raise ProgramFailed(
            f"{program}: files are named relative to the working folder and lie below it (got {name!r})"
        )


def _found(program: str, environment: Mapping[str, str]) -> str:
    """Absolute path of the program: looked up in PATH, or relative to the current folder."""
    place = shutil.which(program, path=environment.get("PATH", os.environ.get("PATH", os.defpath)))
    if place is None:
        where = "there" if os.sep in program else "in PATH"
        raise ProgramFailed(f"{program}: there is no such executable program {where}; install it, or give its path")
    return os.path.abspath(place)


def _environment(folder: str, more: Mapping[str, str]) -> dict[str, str]:
    kept = {name: os.environ[name] for name in KEPT_VARIABLES if name in os.environ}
    return kept | FIXED_VARIABLES | {"HOME": folder, "TMPDIR": folder} | dict(more)


def _put(folder: Path, program: str, files_in: Mapping[str, bytes | Path]) -> None:
    for name, content in files_in.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            if isinstance(content, bytes):
                target.write_bytes(content)
            else:
                with open_regular(content) as source, target.open("wb") as copy:
                    shutil.copyfileobj(source, copy)
        except OSError as problem:
            raise ProgramFailed(f"{program}: its input {name!r} cannot be made ({problem.strerror})") from problem


def _guarded(order: dict[str, Any], log_bytes_max: int) -> tuple[dict[str, Any], CappedLog]:
    """Have the guard run the program; its answer and what the program printed."""
    log = CappedLog(log_bytes_max)
    printed, log_end = os.pipe()
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", guard.__file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            pass_fds=(log_end,),
            start_new_session=True,
        )
    except BaseException:
        os.close(printed)
        raise
    finally:
        os.close(log_end)  # the number stays valid in the guard
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError):  # then there is no answer either
            process.stdin.write(json.dumps(order | {"log": log_end}).encode() + b"\n")
            process.stdin.flush()
        line = _listen(process.stdout.fileno(), printed, log, time.monotonic() + order["timeout_s"] + GUARD_S)
        answer = json.loads(line) if line else {"problem": "the process that watches it ended by itself"}
        return answer, log
    finally:
        os.close(printed)
        _dismiss(process)


def _listen(answers: int, printed: int, log: CappedLog, deadline: float) -> bytes:
    """The guard's answer; meanwhile everything the program prints goes to the log, so that no pipe fills up."""
    line = b""
    os.set_blocking(printed, False)
    with selectors.DefaultSelector() as selector:
        selector.register(answers, selectors.EVENT_READ)
        selector.register(printed, selectors.EVENT_READ)
        while not line.endswith(b"\n"):
            ready = selector.select(max(0.0, deadline - time.monotonic()))
            if not ready:
                return b""
            for key, _ in ready:
                piece = os.read(key.fd, 1 << 16)
                if key.fd == printed:
                    log.add(piece)
                    if not piece:
                        selector.unregister(printed)
                elif piece:
                    line += piece
                else:
                    return line
    _drain(printed, log)
    return line


def _drain(printed: int, log: CappedLog) -> None:
    """What is left in the pipe; it may stay open if a process escaped the guard."""
    try:
        while piece := os.read(printed, 1 << 16):
            log.add(piece)
    except BlockingIOError:
        pass


def _dismiss(process: subprocess.Popen[bytes]) -> None:
    """Let the guard go: the end of its input tells it to end what still runs."""
    for stream in (process.stdin, process.stdout):
        with suppress(BrokenPipeError):
            if stream is not None:
                stream.close()
    try:
        process.wait(GUARD_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _refuse_bad_end(program: str, answer: Mapping[str, Any], log: CappedLog, timeout_s: float) -> None:
    if "problem" in answer:
        raise ProgramFailed(f"{program}: could not be run: {answer['problem']}", log=log.text())
    if answer["timed_out"]:
        end = f"did not end within {timeout_s:g} s and was stopped"
        raise ProgramFailed(f"{program}: {end}; {log.last_words()}", log=log.text())
    status = os.waitstatus_to_exitcode(answer["status"])
    if status:
        end = f"ended with exit code {status}" if status > 0 else f"was ended by signal {_signal_name(-status)}"
        raise ProgramFailed(f"{program}: {end}; {log.last_words()}", status, log.text())


def _signal_name(number: int) -> str:
    try:
        name = signal.Signals(number).name
    except ValueError:
        return str(number)
    return f"{name} (a file larger than allowed)" if number == signal.SIGXFSZ else name


def _taken(
    folder: Path, program: str, wanted: Sequence[str], optional: Sequence[str], file_bytes_max: int, log: CappedLog
) -> dict[str, bytes]:
    """The files that the program wrote, none through a link that leads out of its folder."""
    files: dict[str, bytes] = {}
    root = folder.resolve()
    for name in (*wanted, *optional):
        place = folder / name
        try:
            if not place.resolve().is_relative_to(root):
                raise OSError(0, "is a link out of the working folder")
            files[name] = read_regular(place, file_bytes_max)
        except FileNotFoundError:
            if name in wanted:
                problem = f"ended well but wrote no {name}"
                raise ProgramFailed(f"{program}: {problem}; {log.last_words()}", 0, log.text()) from None
        except (OSError, RuntimeError) as problem:  # until Python 3.12 a loop of links is a RuntimeError
            cause = getattr(problem, "strerror", None) or problem
            raise ProgramFailed(f"{program}: its file {name} cannot be taken: it {cause}", 0, log.text()) from None
    return files
