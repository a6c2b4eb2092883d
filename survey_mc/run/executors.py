"""Where orders are executed: in this process, or on dask workers.

Idea     an executor takes orders and yields (order, outcome or exception) as they finish, with a bounded number in
         flight. `serial` is the reference; results do not depend on the choice. Dask is imported here and nowhere else.
Limits   a local cluster listens on loopback only. For an existing scheduler the run directory must be on a file system
         that its workers share.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from survey_mc.campaign.lock import library_versions
from survey_mc.errors import BadInput, SurveyError
from survey_mc.run.task import Order, Outcome, run_task

if TYPE_CHECKING:
    from distributed import Client

ORDERS_IN_FLIGHT_PER_WORKER = 3
WORKER_DEATHS_ALLOWED = 2  # an order that takes a third worker down is quarantined
CONNECT_TIMEOUT_S = 20
MALLOC_THRESHOLD_BYTES = 128 * 1024 * 1024


class Executor(Protocol):
    name: str
    workers: int

    def execute(self, orders: Iterable[Order]) -> Iterator[tuple[Order, Outcome | Exception]]:
        """Outcomes in order of completion."""


@dataclass(frozen=True, slots=True)
class ExecutorChoice:
    """What the user asked for: serial, a number of local workers, or an existing scheduler (address or file)."""

    serial: bool = False
    workers: int | None = None
    scheduler: str | None = None
    scheduler_file: Path | None = None

    def __post_init__(self) -> None:
        asked = [self.serial, self.workers is not None, self.scheduler is not None, self.scheduler_file is not None]
        if sum(asked) > 1:
            raise BadInput("run", "give only one of --serial, --workers, --scheduler and --scheduler-file")
        if self.workers is not None and not 1 <= self.workers <= MAX_WORKERS:
            raise BadInput("run", f"--workers must be 1..{MAX_WORKERS} (got {self.workers})")


MAX_WORKERS = 1024


@contextmanager
def open_executor(choice: ExecutorChoice) -> Iterator[Executor]:
    """The executor of a choice; a cluster that it starts ends with it."""
    if choice.serial:
        yield SerialExecutor()
    elif choice.scheduler is not None or choice.scheduler_file is not None:
        with _existing_cluster(choice) as client:
            yield DaskExecutor(client, "dask scheduler")
    else:
        with _local_cluster(choice.workers or usable_cores()) as client:
            yield DaskExecutor(client, "dask local cluster")


def usable_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class SerialExecutor:
    """Orders one after the other in this process: the reference."""

    name = "serial"
    workers = 1

    def execute(self, orders: Iterable[Order]) -> Iterator[tuple[Order, Outcome | Exception]]:
        for order in orders:
            try:
                result: Outcome | Exception = run_task(order)
            except Exception as problem:
                result = problem
            yield order, result


class DaskExecutor:
    """Orders on dask workers, a few in flight for each of them."""

    def __init__(self, client: Client, name: str) -> None:
        self.client, self.name = client, name
        self.workers = max(1, sum(client.nthreads().values()))

    def execute(self, orders: Iterable[Order]) -> Iterator[tuple[Order, Outcome | Exception]]:
        from distributed import as_completed

        queue = iter(orders)
        waiting: dict[Any, Order] = {}

        def submit(order: Order) -> Any:
            future = self.client.submit(run_task, order, pure=False)
            waiting[future] = order
            return future

        finished = as_completed(raise_errors=False)
        for order in islice(queue, ORDERS_IN_FLIGHT_PER_WORKER * self.workers):
            finished.add(submit(order))
        while waiting:
            future = next(finished)
            order = waiting.pop(future)
            if future.status in ("cancelled", "lost"):
                raise SurveyError(
                    "the connection to the dask scheduler was lost; what is finished is stored, and the same command "
                    "goes on from there"
                )
            problem = future.exception() if future.status != "finished" else None
            result = problem if problem is not None else future.result()
            future.release()
            following = next(queue, None)
            if following is not None:
                finished.add(submit(following))
            yield order, result


@contextmanager
def _local_cluster(workers: int) -> Iterator[Client]:
    import dask
    from distributed import Client, LocalCluster

    settings = {
        "distributed.scheduler.allowed-failures": WORKER_DEATHS_ALLOWED,
        "distributed.worker.daemon": True,
        "distributed.admin.log-length": 0,
        "logging": {"distributed": "error"},
        # Keep freed memory in the process: a field's arrays are the size of the next one's, and returning them to the
        # system costs a deep field up to 10 ms of page faults.
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": MALLOC_THRESHOLD_BYTES,
        "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": MALLOC_THRESHOLD_BYTES,
        # Tasks run in a thread that is not the main one; two heaps would hold up to 40 MB more.
        "distributed.nanny.pre-spawn-environ.MALLOC_ARENA_MAX": 1,
        # Arrow's own pool would be a third heap, of 35 MB.
        "distributed.nanny.pre-spawn-environ.ARROW_DEFAULT_MEMORY_POOL": "system",
    }
    with dask.config.set(settings), ExitStack() as opened:
        with _undisturbed():
            try:
                cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            except (RuntimeError, TimeoutError) as problem:
                raise SurveyError(
                    f"the {workers} worker processes did not start ({problem}); try again, with fewer --workers or "
                    "--serial"
                ) from problem
            opened.enter_context(cluster)
            client = opened.enter_context(Client(cluster))
        yield client


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Let SIGINT and SIGTERM wait until the workers have started: a cluster that is half there cannot be closed.

    The workers inherit that SIGINT is blocked, so that Ctrl-C in a terminal is for this process alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: held.append(number))
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        if held:
            os.kill(os.getpid(), signal.SIGTERM)


@contextmanager
def _existing_cluster(choice: ExecutorChoice) -> Iterator[Client]:
    from distributed import Client

    where = choice.scheduler or str(choice.scheduler_file)
    # A lost scheduler is one sentence of ours, not pages of its reconnection attempts.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        if choice.scheduler_file is not None:
            if not choice.scheduler_file.is_file():
                raise BadInput(where, "there is no such scheduler file")
            client = Client(scheduler_file=str(choice.scheduler_file), timeout=CONNECT_TIMEOUT_S)
        else:
            client = Client(choice.scheduler, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError, KeyError) as problem:
        raise BadInput(where, f"no dask scheduler answers there ({str(problem)[:120]})") from None
    with client:
        _refuse_other_versions(client, where)
        yield client


def _refuse_other_versions(client: Client, where: str) -> None:
    """Results are promised for one set of versions: a worker that has others is refused."""
    here = library_versions()
    found = client.run(library_versions)
    if not found:
        raise BadInput(where, "the scheduler has no workers; start some with `dask worker`")
    for worker, there in found.items():
        for name, version in here.items():
            if there.get(name) != version:
                raise SurveyError(
                    f"{where}: worker {worker} has {name} {there.get(name)}, this process has {version}; "
                    "install the same versions on both"
                )
