"""Is a process at work in a run directory now?

Idea     the lock file names its holder, and the operating system's list of locks says whether that process holds it.
         Nothing is locked to find out: a test that takes the lock could turn away a run that starts at that moment.
Limits   the list (/proc/locks) is Linux's; elsewhere, and for a holder on another machine, the named process is taken
         at its word, on this machine if it is alive. What a killed process has left in the file is not.
"""

from __future__ import annotations

import json
import os
import socket
from dataclasses import dataclass
from pathlib import Path

from survey_mc.files import open_regular
from survey_mc.store import RunLayout

LOCK_LIST = Path("/proc/locks")
MAX_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Holder:
    """The process that writes to a run directory. is_certain: whether it was found to hold the lock."""

    pid: int
    host: str
    is_certain: bool

    @property
    def phrase(self) -> str:
        """In words."""
        return f"process {self.pid} on {self.host}" + ("" if self.is_certain else " (as its lock file says)")


def holder(layout: RunLayout) -> Holder | None:
    """Who holds the run directory, None if nobody does."""
    try:
        with open_regular(layout.process_lock) as handle:
            named = json.loads(handle.read(MAX_BYTES))
            inode = os.fstat(handle.fileno()).st_ino
        pid, host = int(named["pid"]), str(named["host"])[:80]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    if host != socket.gethostname():
        return Holder(pid, host, is_certain=False)
    holds = _holds(pid, inode)
    if holds is None:
        return Holder(pid, host, is_certain=False) if _is_alive(pid) else None
    return Holder(pid, host, is_certain=True) if holds else None


def _holds(pid: int, inode: int) -> bool | None:
    """Whether a process has a file locked; None where that cannot be seen."""
    try:
        lines = LOCK_LIST.read_text().splitlines()
    except OSError:
        return None
    # "1: FLOCK  ADVISORY  WRITE 4711 fe:00:1572 0 EOF", of the waiting ones "1: -> FLOCK …"
    return any(
        words[1] == "FLOCK" and words[4] == str(pid) and words[5].rpartition(":")[2] == str(inode)
        for words in map(str.split, lines)
        if len(words) > 5
    )


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is somebody else's
        return True
    return True
