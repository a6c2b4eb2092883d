"""What the user asked for: where the work is to be done."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from survey_mc.errors import BadInput

MAX_WORKERS = 1024
DEFAULT_DASHBOARD_PORT = 8787


@dataclass(frozen=True, slots=True)
class ExecutorChoice:
    """What the user asked for: serial, a number of local workers, or an existing scheduler (address or file).

    dashboard_port: serve dask's dashboard on this port of loopback.
    """

    serial: bool = False
    workers: int | None = None
    scheduler: str | None = None
    scheduler_file: Path | None = None
    dashboard_port: int | None = None

    def __post_init__(self) -> None:
        asked = [self.serial, self.workers is not None, self.scheduler is not None, self.scheduler_file is not None]
        if sum(asked) > 1:
            raise BadInput("run", "give only one of --serial, --workers, --scheduler and --scheduler-file")
        if self.workers is not None and not 1 <= self.workers <= MAX_WORKERS:
            raise BadInput("run", f"--workers must be 1..{MAX_WORKERS} (got {self.workers})")
        if self.dashboard_port is not None and (self.serial or self.scheduler or self.scheduler_file):
            raise BadInput("run", "--dashboard is for local workers; an existing scheduler has its own, --serial none")


def usable_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
