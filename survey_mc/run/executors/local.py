"""Worker processes on this machine, reached through loopback alone."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from survey_mc.errors import BadInput, SurveyError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

LOOPBACK = "127.0.0.1"
SAFE_PATH = "PYTHONSAFEPATH"
PATIENCE_S, START_S = 30.0, 120.0  # for all workers, for one
MAIN_GUARD = 'a script that starts a run does so below `if __name__ == "__main__":`'
LOSSES_ALLOWED = 5  # of each worker, while they start
WORKER_DEATHS_ALLOWED = 10  # before an order comes back, to be sent again or given up
MALLOC_THRESHOLD_BYTES = 128 * 1024 * 1024


@contextmanager
def local_cluster(workers: int, dashboard_port: int | None) -> Iterator[LocalWorkers]:
    """A cluster that ends with the block. dashboard_port: serve dask's dashboard there; needs bokeh."""
    import dask
    from distributed import Client, LocalCluster

    _refuse_inside_a_start()
    if dashboard_port is not None:
        _need_bokeh()
    settings = {
        "distributed.scheduler.allowed-failures": WORKER_DEATHS_ALLOWED,
        # A worker is given what it can do now and no more, so that its death concerns nothing else.
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.worker.daemon": True,
        # A worker is restarted by its nanny, however long that takes; see `LocalWorkers` for nannies that give up.
        "distributed.deploy.lost-worker-timeout": "1 hour",
        "distributed.admin.log-length": 0,
        # Nobody looks at dask's statistical profiles of a worker: 100 kB a second, for an hour.
        "distributed.worker.profile.enabled": dashboard_port is not None,
        # dask looks after its own health 50 times a second in every process: idle, a driver with two workers took 12 %
        # of a core, and takes 2 % so.
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.system-monitor.interval": "2s",
        "distributed.worker.memory.monitor-interval": "500ms",
        "distributed.scheduler.work-stealing": False,  # no worker has anything that another could take
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
    with dask.config.set(settings), _safe_path(), ExitStack() as opened:
        with _undisturbed(), warnings.catch_warnings():
            # Of two runs on a machine, one finds the usual port of dask's pages taken; nobody needs to know.
            warnings.filterwarnings("ignore", message="Port .* is already in use", category=UserWarning)
            cluster = opened.enter_context(
                LocalCluster(
                    n_workers=0,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=None if dashboard_port is None else f"{LOOPBACK}:{dashboard_port}",
                    silence_logs=logging.CRITICAL,
                )
            )
            client = opened.enter_context(Client(cluster))
        try:
            local = LocalWorkers(client, cluster, workers)
            local.start()
            yield local
        except BaseException:
            _end_at_once(cluster)
            raise
        finally:
            # A cluster whose end is interrupted is waited for ten seconds when the interpreter ends.
            with _signals_wait():
                opened.close()


@dataclass(slots=True)
class LocalWorkers:
    """A cluster on this machine and its client. n: how many workers it is to have. n_lost: how many died while they
    started, or were given up later."""

    client: Client
    cluster: LocalCluster
    n: int
    n_lost: int = 0

    def start(self) -> None:
        """Return when all workers are there, or some of them after a while; `SurveyError` if none stays alive."""
        # What a worker that dies while it starts has to say is not for the terminal: it is replaced.
        logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
        self.cluster.scale(self.n)
        begun_s = time.monotonic()
        while (n_here := len(self.client.scheduler_info(n_workers=-1)["workers"])) < self.n:
            waited_s = time.monotonic() - begun_s
            if n_here and waited_s > PATIENCE_S:
                return
            if self.n_lost >= LOSSES_ALLOWED * self.n or waited_s > START_S:
                raise SurveyError(
                    f"the {self.n} worker processes did not start; try again, with fewer --workers or --serial; "
                    f"{MAIN_GUARD}"
                )
            time.sleep(0.05)
            self.replace_lost()

    def replace_lost(self) -> None:
        """Start workers for those that died while they were starting: their nannies have given up for good."""
        self.cluster.loop.add_callback(self._replace_lost)

    async def _replace_lost(self) -> None:
        from distributed.core import Status

        lost = [name for name, nanny in self.cluster.workers.items() if nanny.status in (Status.closed, Status.failed)]
        for name in lost:
            del self.cluster.workers[name]
        if lost and self.cluster.status == Status.running:
            self.n_lost += len(lost)
            self.cluster.scale(self.n)


@contextmanager
def _safe_path() -> Iterator[None]:
    """Processes that are started meanwhile do not import from the current folder, in which a stranger's campaign may
    lie beside a `json.py`; what this process imports from there on purpose, workers are told by multiprocessing."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


def _end_at_once(cluster: LocalCluster) -> None:
    """Kill the workers: asked to end, they would finish the field they are at. No file suffers from it."""
    for nanny in cluster.workers.values():
        nanny.close_gracefully()  # so that it starts no other worker
        if nanny.pid:
            os.kill(nanny.pid, signal.SIGKILL)


def _refuse_inside_a_start() -> None:
    """A worker imports the script that started it; one that starts a run while it is imported would go on for ever."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SurveyError(f"a worker process imports the script that started it: {MAIN_GUARD}")


def _need_bokeh() -> None:
    try:
        import bokeh  # type: ignore[import-not-found]  # noqa: F401
    except ImportError:
        raise BadInput("run", "--dashboard needs the package bokeh: pip install 'survey-mc[dashboard]'") from None


@contextmanager
def _signals_wait() -> Iterator[None]:
    """Let SIGINT and SIGTERM wait until the block is over."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = {
        number: signal.signal(number, lambda number, frame: held.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        if held:
            os.kill(os.getpid(), held[0])


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Let signals wait until the workers have started: a cluster that is half there cannot be closed.

    The workers inherit that SIGINT is blocked, so that Ctrl-C in a terminal is for this process alone.
    """
    with _signals_wait():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
