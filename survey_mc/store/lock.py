"""One writer at a time in a run directory.

Idea     an advisory lock of the operating system on `.lock`: it disappears with its process, however that dies, so no
         stale lock has to be guessed. The file also names the holder, for the person who meets it.
Limits   needs a file system with working `flock` (local disks, NFSv4, Lustre with the flock option).
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from survey_mc.errors import BadInput, RunLocked
from survey_mc.store.files import what_it_is
from survey_mc.store.layout import RunLayout


@contextmanager
def run_lock(layout: RunLayout) -> Iterator[None]:
    """Hold the run directory for writing; raises `RunLocked` at once if another process holds it."""
    layout.root.mkdir(parents=True, exist_ok=True)
    layout.refuse_linked_folders()
    found = what_it_is(layout.process_lock)
    if found not in ("", "a file"):
        raise BadInput(str(layout.process_lock), f"is {found}, not a file; remove it if no run is going on")
    handle = os.open(layout.process_lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunLocked(_holder_sentence(layout, os.read(handle, 4096))) from None
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode(), 0)
        yield
        os.ftruncate(handle, 0)
    finally:
        os.close(handle)


def _holder_sentence(layout: RunLayout, content: bytes) -> str:
    try:
        holder = json.loads(content)
        who = f"process {int(holder['pid'])} on {str(holder['host'])[:80]}"
    except (ValueError, KeyError, TypeError, RecursionError):
        who = "another process"
    return f"{layout.root}: {who} is writing to this run directory; wait for it, stop it, or give another --out"
