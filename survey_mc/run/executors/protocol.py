"""What the engine knows of an executor.

Idea     an executor takes orders and yields (order, outcome or exception) as they finish; now and then it yields None,
         so that whoever waits can see that it still lives.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

from survey_mc.run.order import Order, Outcome

Result = tuple[Order, Outcome | Exception] | None


class Executor(Protocol):
    """workers: how many there were at the start, 0 if they are still to come. dashboard: its address, if it has one."""

    name: str
    workers: int
    dashboard: str | None

    def execute(self, orders: Iterable[Order]) -> Iterator[Result]:
        """Outcomes in order of completion; None while there is none to tell of."""

    def workers_now(self) -> int:
        """Worker threads at this moment."""
