"""A field tried in a process of its own, so that only the guilty is blamed.

Idea     where a process has died, a procedure may have taken it down or somebody else may have killed it. The field is
         done again in a child process that is watched: if that one dies too, the procedure it was at has failed on that
         field, with the signal or exit code as the cause, and the child is started again without it.
Limits   a child that somebody kills as well is taken for the procedure's fault; `--retry-failed` tries it again.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import uuid
from collections import deque
from dataclasses import asdict, replace
from pathlib import Path
from typing import IO, Any

from survey_mc.errors import SurveyError
from survey_mc.run.order import CAUSES, Cause, Cost, Failure, Order, Outcome, Suspect
from survey_mc.run.quarantine.attempts import TRACE_CHARACTERS, Death, deaths
from survey_mc.run.quarantine.limits import COMPILATION_SECONDS, FieldLimits
from survey_mc.store import Piece, Record, RunLayout

LINE_BYTES, LINES_KEPT = 4096, 2
GRACE_SECONDS = 60.0  # for start and end of the child, beyond what its own watchdog allows


def timeout_failure(suspect: Suspect, limits: FieldLimits) -> Failure:
    """The failure of a stage whose watchdog has ended its process."""
    return _failure(suspect.realisation, suspect.label, "timeout", timeout_text(limits), suspect.trace)


def _failure(realisation: int, label: str, cause: Cause, text: str, trace: str) -> Failure:
    return Failure(realisation, label, "detect" if label else "draw", cause, text, trace)


def timeout_text(limits: FieldLimits) -> str:
    """The sentence of a time-out."""
    return f"Timeout: {CAUSES['timeout']} ({limits.seconds:g} s, --field-timeout)"


def try_alone(order: Order, where: str) -> Outcome:
    """Do an order of one field in child processes; a method at which one dies is a failure, the others are done.

    where: the cell, for the message of an error. Raises what the child could not blame on a method (disk, store).
    """
    total = Outcome()
    while order.truth or order.detect or order.match:
        result = _in_child(order, where)
        if isinstance(result, Outcome):
            total.absorb(result)
            break
        failure = _verdict(order, *result)
        total.failures.append(failure)
        if not failure.method or failure.method not in (*order.detect, *order.match):
            break
        order = order.without(failure.method)
    return total


def _in_child(order: Order, where: str) -> Outcome | tuple[int, Death]:
    """The outcome of a child process, or its exit code and the note it left."""
    folder = RunLayout(order.root).attempts
    folder.mkdir(parents=True, exist_ok=True)
    name = f"alone-{uuid.uuid4().hex}"
    wanted, answer = folder / f"{name}.order.json", folder / f"{name}.outcome.json"
    wanted.write_text(json.dumps(order_content(order) | {"name": name}), encoding="utf-8")
    # It imports what this process imports, from the current folder only if this one does.
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path or str(Path.cwd()) for path in sys.path)}
    command = [sys.executable, "-P", "-m", "survey_mc.run.quarantine.lone_field", str(wanted), str(answer)]
    n_steps = 1 + 2 * len({*order.detect, *order.match})
    patience_s = (order.limits.seconds * 1.2 + COMPILATION_SECONDS) * n_steps + GRACE_SECONDS
    said: deque[bytes] = deque(maxlen=LINES_KEPT)
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment
    ) as child:
        listener = threading.Thread(target=_listen, args=(child.stderr, said), daemon=True)
        listener.start()
        try:
            child.wait(patience_s if order.limits.seconds else None)
        except subprocess.TimeoutExpired:
            pass
        finally:
            child.kill()
            child.wait()
            # What it has left behind may hold the pipe open.
            listener.join(timeout=1.0)
    try:
        if child.returncode == 0 and answer.is_file():
            return _outcome(json.loads(answer.read_text(encoding="utf-8")), where)
        death = next(deaths(folder, name), None)
        words = b"".join(said).decode("utf-8", errors="replace")[-TRACE_CHARACTERS:]
        if death is None:
            raise RuntimeError(f"{where}: {_exit_text(child.returncode)} before it was at any field: {words[-400:]}")
        return child.returncode, death if death.trace else replace(death, trace=words)
    finally:
        for path in folder.glob(f"{name}.*"):
            path.unlink(missing_ok=True)


def _listen(pipe: IO[bytes], said: deque[bytes]) -> None:
    """Keep the end of what a child says, and its pipe empty."""
    while part := pipe.read1(LINE_BYTES):  # type: ignore[attr-defined]
        said.append(part)


def _verdict(order: Order, exit_code: int, death: Death) -> Failure:
    label = death.place.label if death.place else ""
    if death.timed_out:
        return _failure(order.start, label, "timeout", timeout_text(order.limits), death.trace)
    return _failure(order.start, label, "crash", f"{_exit_text(exit_code)}, twice at this place", death.trace)


def _exit_text(exit_code: int) -> str:
    if exit_code >= 0:
        return f"Exit {exit_code}: its process left with this code"
    name = signal.Signals(-exit_code).name if -exit_code in set(signal.Signals) else f"signal {-exit_code}"
    hint = " (a lack of memory?)" if -exit_code == signal.SIGKILL else ""
    return f"{name}: its process was ended by this signal{hint}"


def record_content(record: Record) -> list[Any]:
    """A record as JSON."""
    return [record.piece.path, record.sha256, record.rows, record.size_bytes, record.schema_version]


def record_of(content: list[Any]) -> Record:
    """The inverse of `record_content`."""
    path, *others = content
    piece = Piece.from_path(path)
    if piece is None:
        raise ValueError(f"{path!r} is no stored file")
    return Record(piece, *others)


def order_content(order: Order) -> dict[str, Any]:
    """An order of a run as JSON; its campaign is the one that the run directory holds."""
    return {
        "root": str(order.root),
        "cell": order.cell_index,
        "start": order.start,
        "stop": order.stop,
        "truth": order.truth,
        "detect": order.detect,
        "match": order.match,
        "stored": {label: [record_content(record) for record in records] for label, records in order.stored.items()},
        "limits": asdict(order.limits),
    }


def outcome_content(outcome: Outcome) -> dict[str, Any]:
    """An outcome as JSON, the inverse of what the parent reads."""
    return {
        "records": [record_content(record) for record in outcome.records],
        "failures": [asdict(failure) for failure in outcome.failures],
        "skips": outcome.skips,
        "costs": [[*place, asdict(cost)] for place, cost in outcome.costs.items()],
    }


def _outcome(content: dict[str, Any], where: str) -> Outcome:
    if "disk" in content:
        raise OSError(*content["disk"])
    if "refused" in content:
        raise SurveyError(f"{where}: {content['refused']}")
    return Outcome(
        records=[record_of(entry) for entry in content["records"]],
        failures=[Failure(**failure) for failure in content["failures"]],
        skips=[(int(realisation), method, reason) for realisation, method, reason in content["skips"]],
        costs={(method, stage): Cost(**cost) for method, stage, cost in content["costs"]},
    )
