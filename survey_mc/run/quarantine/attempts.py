"""Notes of what a process is working on, for whoever finds it dead.

Idea     a worker writes the place of its work (field, procedure, stage) over and over into one small file and removes
         it when the order is finished. What a dead process leaves says where it died, with the traceback that the
         interpreter wrote on its way out. Only that place is suspect; work that merely waited in the same process is
         not.
Limits   a note says where a process died and not why: one that was killed from outside leaves the same note as one that
         a procedure took down. The suspect is therefore tried again in a process of its own before it is blamed.
"""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import socket
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.run.quarantine.watchdog import STDERR, TIMEOUT_MARK, Watchdog

PLACE_BYTES = 1024
TRACE_CHARACTERS = 4000
PATIENCE_WITH_OWN_PROCESS = 2.0


@dataclass(frozen=True, slots=True)
class Place:
    """Where the work is. key: field key (drawing) or detect key. label: method, empty for drawing. stage: draw, detect,
    match."""

    key: str
    realisation: int
    label: str
    stage: str


@dataclass(frozen=True, slots=True)
class Death:
    """What a dead process was at. place: None if it was at no field. timed_out: its watchdog ended it."""

    place: Place | None
    timed_out: bool
    trace: str
    note: Path


class FieldTimeout(BaseException):
    """A stage in the main thread has taken too long. No `except Exception` of a procedure stops it."""


class AttemptNote:
    """The note of this process and its watchdog, in a `with` block around an order.

    name: of the order, the beginning of the file's name. own_process: the process is the user's own and this is its
    main thread: a stage that takes too long is interrupted by an exception, and only if compiled code lets none through
    the watchdog ends the process later, with its report on stderr.
    """

    def __init__(self, folder: Path, name: str, limits: FieldLimits, *, own_process: bool = False) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{name}.{uuid.uuid4().hex}.note"
        self.limits = limits
        self._file = self.path.open("w+b", buffering=0)
        self._head = {"host": socket.gethostname(), "pid": os.getpid()}
        self._own_handler = not faulthandler.is_enabled()
        self._own_process, self._at_work = own_process, False
        self._watchdog = Watchdog(STDERR if own_process else self._file)

    def __enter__(self) -> AttemptNote:
        self._write(None)
        os.lseek(self._file.fileno(), PLACE_BYTES, os.SEEK_SET)
        if self._own_handler:
            faulthandler.enable(file=self._file, all_threads=False)
        if self._own_process:
            self._before = signal.signal(signal.SIGALRM, self._ring)
        return self

    def at(self, place: Place | None, extra_s: float = 0.0) -> None:
        """The work is there now; it may stay as long as the limits say and `extra_s` more, at no place for ever."""
        self._write(place)
        if place is None or not self.limits.seconds:
            self._watchdog.step(None)
            return
        allowed_s = self.limits.seconds + extra_s
        if self._own_process:
            self._at_work = True
            signal.setitimer(signal.ITIMER_REAL, allowed_s)
            allowed_s *= PATIENCE_WITH_OWN_PROCESS
        self._watchdog.step(allowed_s)

    def rest(self) -> None:
        """The stage is over, whatever came of it."""
        if self._at_work:
            self._at_work = False
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _ring(self, number: int, frame: FrameType | None) -> None:
        if self._at_work:
            raise FieldTimeout

    def _write(self, place: Place | None) -> None:
        where = None if place is None else {name: getattr(place, name) for name in Place.__slots__}
        os.pwrite(self._file.fileno(), json.dumps(self._head | {"place": where}).encode().ljust(PLACE_BYTES), 0)

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, at: TracebackType | None
    ) -> None:
        self._watchdog.stop()
        self.rest()
        if self._own_process:
            signal.signal(signal.SIGALRM, self._before)
        if self._own_handler:
            faulthandler.disable()
        self._file.close()
        self.path.unlink(missing_ok=True)


def deaths(folder: Path, name: str = "") -> Iterator[Death]:
    """What the processes left that died at an order of that name (default: at any); those alive here are passed by."""
    if not folder.is_dir():
        return
    for path in sorted(folder.glob(f"{name}.*.note" if name else "*.note")):
        death = _read(path)
        if death is not None:
            yield death


def _read(path: Path) -> Death | None:
    try:
        content = path.read_bytes()
    except OSError:  # its process has just finished
        return None
    trace = content[PLACE_BYTES:].decode("utf-8", errors="replace")[:TRACE_CHARACTERS]
    try:
        head: dict[str, Any] = json.loads(content[:PLACE_BYTES])
        place = None if head["place"] is None else Place(**head["place"])
        if head["host"] == socket.gethostname() and _alive(int(head["pid"])):
            return None
    except (ValueError, KeyError, TypeError):
        place = None
    return Death(place, trace.startswith(TIMEOUT_MARK), trace, path)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


def forget(folder: Path) -> None:
    """Remove all notes and their folder: what was to be learnt from them is known."""
    if folder.is_dir():
        for path in folder.iterdir():
            path.unlink(missing_ok=True)
        folder.rmdir()
