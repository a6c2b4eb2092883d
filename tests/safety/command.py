"""The command line in this process, and what lies in a folder before and after."""

from __future__ import annotations

import contextlib
import io
import os
import resource
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from survey_mc.cli import main

PATIENCE_S = 30
MEMORY_MORE_BYTES = 3_000_000_000  # beyond what is mapped already; so much that only something endless needs it


@dataclass(frozen=True)
class Answer:
    """What a command said and its exit code."""

    code: int
    out: str
    err: str

    @property
    def is_one_sentence(self) -> bool:
        return self.err.startswith("survey-mc: ") and self.err.count("\n") == 1 and "Traceback" not in self.err


def command(*arguments: object) -> Answer:
    """Run a verb; one that does not come back, or reads without end, is interrupted, which fails the test."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), _patience(), less_memory(MEMORY_MORE_BYTES):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as left:
            code = int(left.code or 0)
    return Answer(code, out.getvalue(), err.getvalue())


@contextlib.contextmanager
def _patience() -> Iterator[None]:
    def stop(number: int, frame: object) -> None:
        raise AssertionError(f"no answer within {PATIENCE_S} s")

    before = {number: signal.getsignal(number) for number in (signal.SIGALRM, signal.SIGTERM)}
    signal.signal(signal.SIGALRM, stop)
    signal.alarm(PATIENCE_S)
    try:
        yield
    finally:
        signal.alarm(0)
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def less_memory(more_bytes: int) -> Iterator[None]:
    """An allocation that would not fit fails, as it would on a small machine."""
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    limits = [limit for limit in (mapped + more_bytes, *before) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min(limits), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def contents(folder: Path) -> dict[str, bytes | str]:
    """Every name below a folder with its bytes, or what kind of thing it is."""
    found: dict[str, bytes | str] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}"
        elif path.is_file():
            found[name] = path.read_bytes()
        else:
            found[name] = "directory" if path.is_dir() else "other"
    return found
