"""Orders on dask workers, a bounded number in flight.

Idea     dask counts the death of a worker against every task that it had been given. Here it only means that the order
         is sent again: who is guilty is found out by the next attempt at it (see `attempts`).
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import TYPE_CHECKING, Any

from survey_mc.errors import SurveyError
from survey_mc.run.executors.protocol import Result
from survey_mc.run.order import Order, Outcome
from survey_mc.run.task import run_task

if TYPE_CHECKING:
    from distributed import Client

ORDERS_IN_FLIGHT_PER_WORKER = 3
SUBMISSIONS_ALLOWED = 5  # of an order that dies before it can leave a note
TICK_S = 2.0


class DaskExecutor:
    """Orders on dask workers, a few in flight for each of them.

    workerless_s: give up when there has been no worker for so long; None waits for ever, as one does for a queue.
    replace_lost: called every tick, to start workers for those that will not come back.
    """

    def __init__(
        self,
        client: Client,
        name: str,
        dashboard: str | None = None,
        *,
        workerless_s: float | None = None,
        replace_lost: Callable[[], None] = lambda: None,
    ) -> None:
        self.client, self.name, self.dashboard, self.workerless_s = client, name, dashboard, workerless_s
        self.replace_lost = replace_lost
        self._asked_s, self._n_workers = float("-inf"), 0
        self._seen_s = time.monotonic()
        self.workers = self.workers_now()

    def workers_now(self) -> int:
        """Worker threads, as the scheduler said at most one tick ago."""
        now = time.monotonic()
        if now - self._asked_s > TICK_S:
            self._asked_s = now
            self.replace_lost()
            try:
                workers = self.client.scheduler_info(n_workers=-1)["workers"]
            except (OSError, KeyError):  # a scheduler that is gone is noticed by its futures
                workers = {}
            self._n_workers = sum(worker["nthreads"] for worker in workers.values())
        return self._n_workers

    def execute(self, orders: Iterable[Order]) -> Iterator[Result]:
        todo = iter(orders)
        finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        waiting: dict[Any, tuple[Order, int]] = {}

        def submit(order: Order, times: int = 1) -> None:
            with _scheduler_needed():
                future = self.client.submit(run_task, order, pure=False)
            waiting[future] = order, times
            future.add_done_callback(finished.put)

        def fill() -> None:
            room = ORDERS_IN_FLIGHT_PER_WORKER * max(1, self.workers_now()) - len(waiting)
            for order in islice(todo, max(0, room)):
                submit(order)

        fill()
        while waiting:
            try:
                future = finished.get(timeout=TICK_S)
            except queue.Empty:
                self._check_life()
                fill()
                yield None
                continue
            order, times = waiting.pop(future)
            result = _result(future)
            if result is None:
                submit(order, times)
                continue
            if _is_death(result) and times < SUBMISSIONS_ALLOWED:
                submit(order, times + 1)
                continue
            fill()
            yield order, result

    def _check_life(self) -> None:
        if self.client.status not in ("running", "connecting"):
            raise _lost_scheduler()
        now = time.monotonic()
        if self.workerless_s is None or self.workers_now() > 0:
            self._seen_s = now
        elif now - self._seen_s > self.workerless_s:
            raise SurveyError(
                f"there has been no worker process for {self.workerless_s:g} s; what is finished is stored, and the "
                "same command goes on from there, perhaps with fewer --workers"
            )


def _lost_scheduler() -> SurveyError:
    return SurveyError(
        "the connection to the dask scheduler was lost; what is finished is stored, and the same command goes on from "
        "there"
    )


def _result(future: Any) -> Outcome | Exception | None:
    """What a finished future holds; None where it was lost with its worker before it could be fetched. Raises where the
    scheduler is lost."""
    if future.status == "cancelled":
        raise _lost_scheduler()
    if future.status not in ("finished", "error"):
        future.release()
        return None
    try:
        with _scheduler_needed():
            result: Outcome | Exception = future.exception() if future.status == "error" else future.result()
    except OSError:  # of a scheduler that is gone, `_check_life` hears soon
        return None
    future.release()
    return result


@contextmanager
def _scheduler_needed() -> Iterator[None]:
    from distributed import CancelledError
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, ClosedClientError):
        raise _lost_scheduler() from None


def _is_death(result: Outcome | Exception) -> bool:
    from distributed import KilledWorker

    return isinstance(result, KilledWorker)
