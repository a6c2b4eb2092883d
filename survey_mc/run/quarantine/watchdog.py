"""Stops a process whose work does not get on.

Idea     a dead man's switch: a timer of the interpreter that needs no lock of it (`faulthandler`) writes down where
         every thread is and ends the process, unless a small thread finds at regular looks that the work has moved on
         and sets the timer anew. Compiled code that holds the interpreter's lock forever stops that thread, and is
         stopped by the timer.
Limits   one in a process. The process ends a tenth to a fifth of the allowed time too late.
"""

from __future__ import annotations

import faulthandler
import threading
from typing import IO

LOOKS_PER_LIMIT = 10
STDERR = 2
TIMEOUT_MARK = "Timeout ("  # how the interpreter's report begins


class Watchdog:
    """Guards the steps of a piece of work until `stop`. report: file or descriptor for the traceback."""

    def __init__(self, report: IO[bytes] | int) -> None:
        self.report = report
        self._steps = 0
        self._allowed_s: float | None = None
        self._changed = threading.Event()
        self._ended = False
        self._thread: threading.Thread | None = None

    def step(self, allowed_s: float | None) -> None:
        """A new step begins; it may take that long, None for ever."""
        before = self._allowed_s
        self._steps += 1
        if allowed_s == before:
            return
        # Set here and now: a step that never lets another thread run must not find the timer of an earlier one.
        self._allowed_s = allowed_s
        self._set_timer()
        self._changed.set()
        if self._thread is None:
            self._thread = threading.Thread(target=self._look, name="watchdog", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """The work is done."""
        if self._thread is not None:
            self._ended = True
            self._changed.set()
            self._thread.join()
            faulthandler.cancel_dump_traceback_later()

    def _set_timer(self) -> None:
        allowed_s = self._allowed_s
        if allowed_s is None:
            faulthandler.cancel_dump_traceback_later()
        else:
            limit_s = allowed_s * (1.0 + 1.0 / LOOKS_PER_LIMIT)
            faulthandler.dump_traceback_later(limit_s, exit=True, file=self.report)  # type: ignore[arg-type]

    def _look(self) -> None:
        seen = self._steps
        while not self._ended:
            if self._steps != seen:
                seen = self._steps
                self._set_timer()
            allowed_s = self._allowed_s
            self._changed.wait(None if allowed_s is None else allowed_s / LOOKS_PER_LIMIT)
            self._changed.clear()
