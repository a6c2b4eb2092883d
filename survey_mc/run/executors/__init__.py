"""Where orders are executed: in this process, or on dask workers. Dask is imported here and nowhere else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from survey_mc.run.executors.choice import MAX_WORKERS, ExecutorChoice, usable_cores
from survey_mc.run.executors.dask_workers import DaskExecutor
from survey_mc.run.executors.existing import existing_cluster
from survey_mc.run.executors.local import local_cluster
from survey_mc.run.executors.protocol import Executor
from survey_mc.run.executors.serial import SerialExecutor

__all__ = ["MAX_WORKERS", "Executor", "ExecutorChoice", "open_executor", "usable_cores"]

WORKERLESS_S = 120.0  # a local cluster that has no worker for so long cannot start any


@contextmanager
def open_executor(choice: ExecutorChoice) -> Iterator[Executor]:
    """The executor of a choice; a cluster that it starts ends with it."""
    if choice.serial:
        yield SerialExecutor()
    elif choice.scheduler is not None or choice.scheduler_file is not None:
        with existing_cluster(choice.scheduler, choice.scheduler_file) as client:
            yield DaskExecutor(client, "dask scheduler", client.dashboard_link or None)
    else:
        with local_cluster(choice.workers or usable_cores(), choice.dashboard_port) as local:
            link = local.client.dashboard_link if choice.dashboard_port is not None else None
            yield DaskExecutor(
                local.client, "dask local cluster", link, workerless_s=WORKERLESS_S, replace_lost=local.replace_lost
            )
