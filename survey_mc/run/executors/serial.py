"""Orders one after the other in this process: the reference."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from survey_mc.run.executors.protocol import Result
from survey_mc.run.order import Order, Outcome
from survey_mc.run.task import run_task


class SerialExecutor:
    """The reference executor: every other one gives the same results."""

    name = "serial"
    workers = 1
    dashboard: str | None = None

    def execute(self, orders: Iterable[Order]) -> Iterator[Result]:
        for order in orders:
            try:
                result: Outcome | Exception = run_task(order)
            except Exception as problem:
                result = problem
            yield order, result

    def workers_now(self) -> int:
        return 1
