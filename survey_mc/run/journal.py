"""Who ran what when: one JSON line an event, never part of a result.

Idea     times, hosts, costs, failures and skips live here and nowhere else, so results stay the same bytes on any
         machine.
"""

from __future__ import annotations

import os
import shlex
import socket
import sys
import time
from datetime import UTC, datetime
from typing import Any

from survey_mc.run.order import Order, Outcome
from survey_mc.store import RunLayout
from survey_mc.store.journal_lines import seal_line


class Journal:
    """Append-only log of one run; a new file for every start."""

    def __init__(self, layout: RunLayout) -> None:
        layout.journals.mkdir(parents=True, exist_ok=True)
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        self.name = f"{stamp}-{os.getpid()}"
        self.path = layout.journals / f"{self.name}.jsonl"
        self.begun_s = time.perf_counter()

    def write(self, event: str, **content: Any) -> None:
        """Append one event."""
        line = seal_line({"event": event, "run": self.name, "at": datetime.now(UTC).isoformat(), **content})
        with self.path.open("a", encoding="utf-8") as handle:
            handle.write(line)

    def start(self, executor: str, workers: int, n_fields: int, block: int) -> None:
        self.write(
            "start",
            executor=executor,
            workers=workers,
            fields=n_fields,
            block=block,
            host=socket.gethostname(),
            pid=os.getpid(),
            argv=sys.argv[1:],
        )

    def task(self, cell_label: str, order: Order, outcome: Outcome, keys: dict[str, str], where: str) -> None:
        """Costs of a finished order, and a line for each failure and skip in it.

        keys: detect key of each method and, under the empty label, the key of the field.
        """
        self.write(
            "task",
            cell=cell_label,
            start=order.start,
            stop=order.stop,
            host=outcome.host,
            pid=outcome.pid,
            peak_mb=round(outcome.peak_mb, 1),
            costs=[
                {"method": m, "stage": s, "fields": c.fields, "cpu_s": round(c.cpu_s, 6), "wall_s": round(c.wall_s, 6)}
                for (m, s), c in outcome.costs.items()
            ],
        )
        for failure in outcome.failures:
            replay = _replay_command(where, order, failure.realisation)
            self.write(
                "failure",
                cell=cell_label,
                realisation=failure.realisation,
                method=failure.method,
                key=keys.get(failure.method, ""),
                stage=failure.stage,
                cause=failure.cause,
                error=failure.error,
                trace=failure.trace,
                replay=replay + (f" --method {shlex.quote(failure.method)}" if failure.method else ""),
            )
        for realisation, method, reason in outcome.skips:
            self.write(
                "skip",
                cell=cell_label,
                realisation=realisation,
                method=method,
                key=keys.get(method, ""),
                reason=reason,
            )

    def quarantine(self, cell_label: str, order: Order, keys: dict[str, str], error: str, where: str) -> None:
        """An order that could not be finished at all (its worker died, or the store refused)."""
        self.write(
            "quarantine",
            cell=cell_label,
            start=order.start,
            stop=order.stop,
            keys=sorted(keys.values()),
            cause="crash",
            error=error[:2000],
            replay=_replay_command(where, order, order.start),
        )

    def finish(self, **content: Any) -> None:
        self.write("finish", wall_s=round(time.perf_counter() - self.begun_s, 3), **content)


def _replay_command(where: str, order: Order, realisation: int) -> str:
    return f"survey-mc replay {shlex.quote(where)} --cell {order.cell_index} --realisation {realisation}"
