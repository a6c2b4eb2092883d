"""`python -m survey_mc.run.quarantine.lone_field ORDER.json OUTCOME.json`: one field in a process that may die of it.

Idea     the other end of `isolated`: reads what is to be done, does it like any worker, writes what came of it. It ends
         with its parent: standard input is a pipe that closes when the parent is gone.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from pathlib import Path
from typing import Any

from survey_mc.campaign import load_run_campaign
from survey_mc.errors import SurveyError
from survey_mc.run.order import Order
from survey_mc.run.quarantine.attempts import AttemptNote
from survey_mc.run.quarantine.isolated import outcome_content, record_of
from survey_mc.run.quarantine.limits import FieldLimits, limited_memory
from survey_mc.run.task import do_order
from survey_mc.store import RunLayout

ORPHANED = 1


def _order(content: dict[str, Any]) -> Order:
    root = Path(content["root"])
    return Order(
        campaign=load_run_campaign(root),
        root=root,
        cell_index=content["cell"],
        start=content["start"],
        stop=content["stop"],
        truth=content["truth"],
        detect=tuple(content["detect"]),
        match=tuple(content["match"]),
        stored={label: tuple(map(record_of, records)) for label, records in content["stored"].items()},
        limits=FieldLimits(**content["limits"]),
    )


def _answer(content: dict[str, Any]) -> dict[str, Any]:
    try:
        order = _order(content)
        with (
            limited_memory(order.limits),
            AttemptNote(RunLayout(order.root).attempts, content["name"], order.limits) as note,
        ):
            return outcome_content(do_order(order, note))
    except OSError as problem:
        return {"disk": [problem.errno, problem.strerror, str(problem.filename or "")]}
    except SurveyError as problem:
        return {"refused": str(problem)}


def _end_with_parent() -> None:
    while os.read(0, 1):  # not through sys.stdin, whose lock a thread must not hold when the interpreter ends
        pass
    os._exit(ORPHANED)


def main() -> None:
    """Do the order named on the command line."""
    wanted, answer = (Path(argument) for argument in sys.argv[1:])
    threading.Thread(target=_end_with_parent, daemon=True).start()
    content = _answer(json.loads(wanted.read_text(encoding="utf-8")))
    temporary = answer.with_suffix(".tmp")
    temporary.write_text(json.dumps(content), encoding="utf-8")
    temporary.replace(answer)


if __name__ == "__main__":
    main()
