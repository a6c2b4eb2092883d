"""Worker processes on this machine, reached through loopback alone."""

from __future__ import annotations

import logging
import os
import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from survey_mc.errors import BadInput, SurveyError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

LOOPBACK = "127.0.0.1"
SAFE_PATH = "PYTHONSAFEPATH"
WORKER_DEATHS_ALLOWED = 10  # before an order comes back, to be sent again or given up
MALLOC_THRESHOLD_BYTES = 128 * 1024 * 1024


@contextmanager
def local_cluster(workers: int, dashboard_port: int | None) -> Iterator[Client]:
    """A cluster that ends with the block. dashboard_port: serve dask's dashboard there; needs bokeh."""
    import dask
    from distributed import Client, LocalCluster

    if dashboard_port is not None:
        _need_bokeh()
    settings = {
        "distributed.scheduler.allowed-failures": WORKER_DEATHS_ALLOWED,
        # A worker is given what it can do now and no more, so that its death concerns nothing else.
        "distributed.scheduler.worker-saturation": 1.0,
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
    with dask.config.set(settings), _safe_path(), ExitStack() as opened:
        with _undisturbed(), warnings.catch_warnings():
            try:
                # Of two runs on a machine, one finds the usual port of dask's pages taken; nobody needs to know.
                warnings.filterwarnings("ignore", message="Port .* is already in use", category=UserWarning)
                cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=None if dashboard_port is None else f"{LOOPBACK}:{dashboard_port}",
                    silence_logs=logging.CRITICAL,
                )
            except (RuntimeError, TimeoutError) as problem:
                raise SurveyError(
                    f"the {workers} worker processes did not start ({problem}); try again, with fewer --workers or "
                    "--serial"
                ) from problem
            opened.enter_context(cluster)
            client = opened.enter_context(Client(cluster))
        try:
            yield client
        except BaseException:
            _end_at_once(cluster)
            raise


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


def _need_bokeh() -> None:
    try:
        import bokeh  # type: ignore[import-not-found]  # noqa: F401
    except ImportError:
        raise BadInput("run", "--dashboard needs the package bokeh: pip install 'survey-mc[dashboard]'") from None


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
