"""Starts one program, waits for it, and ends all that it started. A script of its own: `python -I -S guard.py`.

Idea     the guard adopts every process that the program leaves behind (it is their "subreaper"), so none escapes by
         forking twice or by opening a session of its own. When the pipe on its input ends, whoever asked has died:
         then the program ends too.
Source   prctl(2), PR_SET_CHILD_SUBREAPER, Linux 3.4.
Limits   on other systems the process group of the program is ended, and nothing beyond it. Only the standard library is
         imported, so that a start takes some 20 ms.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import resource
import select
import signal
import sys
import time

TYPE_CHECKING = False  # as typing has it, whose import would take as long as all the others
if TYPE_CHECKING:
    from typing import Any

PR_SET_CHILD_SUBREAPER = 36
POLITE_S = 2.0  # between SIGTERM and SIGKILL
END_S = 10.0  # for killed processes to disappear; one that hangs in the kernel may not
NOT_STARTED = 127


def main() -> None:
    """One order as a line of JSON on standard input; one line of JSON on standard output says how it ended."""
    order = json.loads(_first_line(0))
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    wake, waker = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    for number in (signal.SIGCHLD, signal.SIGTERM):
        signal.signal(number, lambda number, frame: None)  # they only wake the waiting below
    signal.set_wakeup_fd(waker, warn_on_full_buffer=False)
    program, problem = _start(order)
    if problem is not None:
        _answer({"problem": problem})
        return
    status, timed_out, abandoned = _wait(program, wake, time.monotonic() + order["timeout_s"])
    if timed_out:
        status = _end_politely(program, wake)
    left = _end_all(program)
    _answer({"status": status, "timed_out": timed_out, "left": left})
    if abandoned:
        import shutil

        shutil.rmtree(order["folder"], ignore_errors=True)


def _first_line(handle: int) -> bytes:
    line = b""
    while not line.endswith(b"\n"):
        piece = os.read(handle, 1 << 16)
        if not piece:
            raise SystemExit(1)
        line += piece
    return line


def _limit(what: int, value: int) -> None:
    with contextlib.suppress(OSError, ValueError):
        _, most = resource.getrlimit(what)
        least = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(what, (least, least))


def _start(order: dict[str, Any]) -> tuple[int, str | None]:
    """Process id of the program, or why it could not be started."""
    said, say = os.pipe2(os.O_CLOEXEC)
    program = os.fork()
    if program == 0:
        try:
            os.setsid()
            os.umask(0o077)
            os.chdir(order["folder"])
            nothing = os.open(os.devnull, os.O_RDONLY)
            for ours, theirs in ((nothing, 0), (order["log"], 1), (order["log"], 2)):
                os.dup2(ours, theirs)
            os.set_inheritable(order["log"], False)
            for number in (signal.SIGCHLD, signal.SIGTERM, signal.SIGPIPE, signal.SIGXFSZ):
                signal.signal(number, signal.SIG_DFL)
            _limit(resource.RLIMIT_CORE, 0)
            _limit(resource.RLIMIT_FSIZE, order["file_bytes_max"])
            if order["memory_bytes_max"] is not None:
                _limit(resource.RLIMIT_AS, order["memory_bytes_max"])
            os.execve(order["program"], order["argv"], order["environment"])
        except BaseException as error:
            os.write(say, str(getattr(error, "strerror", None) or error).encode())
        os._exit(NOT_STARTED)
    os.close(say)
    os.close(order["log"])
    problem = os.read(said, 1000).decode(errors="replace")
    os.close(said)
    return program, problem or None


def _wait(program: int, wake: int, deadline: float) -> tuple[int | None, bool, bool]:
    """Wait status of the program; whether its time ran out; whether nobody waits for it any more."""
    while True:
        status = _reap(program)
        if status is not None:
            return status, False, False
        remaining_s = deadline - time.monotonic()
        if remaining_s <= 0.0:
            return None, True, False
        ready = select.select([0, wake], [], [], remaining_s)[0]
        told_to_end = wake in ready and signal.SIGTERM in os.read(wake, 1 << 12)
        if told_to_end or (0 in ready and not os.read(0, 1 << 12)):
            return None, False, True


def _end_politely(program: int, wake: int) -> int | None:
    _signal_group(program, signal.SIGTERM)
    deadline = time.monotonic() + POLITE_S
    while (status := _reap(program)) is None and (remaining_s := deadline - time.monotonic()) > 0.0:
        if select.select([wake], [], [], remaining_s)[0]:
            os.read(wake, 1 << 12)
    return status


def _reap(program: int) -> int | None:
    """Bury all that has ended; the wait status of the program if it has."""
    found = None
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            if ended[0] == program:
                found = ended[1]
    return found


def _end_all(program: int) -> int:
    """Kill the process group and all descendants until none is left; how many the program had left behind."""
    left = len(_descendants() - {program})
    deadline = time.monotonic() + END_S
    while time.monotonic() < deadline:
        _signal_group(program, signal.SIGKILL)
        for number in (signal.SIGSTOP, signal.SIGKILL):  # what is stopped starts no more
            for process in _descendants():
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(process, number)
        _reap(program)
        try:
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                time.sleep(0.005)
        except ChildProcessError:
            break
    return left


def _signal_group(program: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(program, number)


def _descendants() -> set[int]:
    """Processes below this one that have not ended, from /proc; none where there is no /proc."""
    parents: dict[int, int] = {}
    try:
        numbers = [int(name) for name in os.listdir("/proc") if name.isdigit()]
    except OSError:
        return set()
    for number in numbers:
        with contextlib.suppress(OSError, ValueError, IndexError), open(f"/proc/{number}/stat", "rb") as stream:
            state, parent = stream.read().rpartition(b")")[2].split()[:2]
            if state != b"Z":
                parents[number] = int(parent)
    found: set[int] = set()
    newest = {os.getpid()}
    while newest := {number for number, parent in parents.items() if parent in newest} - found:
        found |= newest
    return found


def _answer(content: dict[str, Any]) -> None:
    with contextlib.suppress(OSError):  # nobody may be listening any more
        os.write(1, json.dumps(content).encode() + b"\n")


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    main()
