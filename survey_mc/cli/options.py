"""Options that several verbs share."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import click

from survey_mc.errors import BadInput

F = TypeVar("F", bound=Callable[..., Any])

# Existence is checked by the loaders, which say what is wrong in one sentence.
PATH = click.Path(path_type=Path)

campaign_argument = click.argument("campaign", type=PATH, metavar="CAMPAIGN.toml")
run_argument = click.argument("run", type=PATH, metavar="RUN")
out_option = click.option("--out", type=PATH, metavar="DIR", help="Run directory.  [default: results/<name>]")
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document for machines.")


def executor_options(verb: F) -> F:
    """Where the work is done and what it may take: the verb gets `executor` and `limits`."""

    @wraps(verb)
    def with_choices(
        *arguments: Any,
        workers: int | None,
        serial: bool,
        scheduler: str | None,
        scheduler_file: Path | None,
        dashboard: int | None,
        field_timeout: float,
        memory_limit: int,
        **others: Any,
    ) -> Any:
        from survey_mc.run import FieldLimits
        from survey_mc.run.executors import ExecutorChoice

        executor = ExecutorChoice(serial, workers, scheduler, scheduler_file, dashboard)
        return verb(*arguments, executor=executor, limits=FieldLimits(field_timeout, memory_limit), **others)

    wrapped: Any = with_choices
    for option in (
        click.option(
            "--memory-limit",
            type=int,
            default=4096,
            show_default=True,
            metavar="MB",
            help="Memory of a worker process; a method that asks for more fails on that field. 0: no limit.",
        ),
        click.option(
            "--field-timeout",
            type=float,
            default=600.0,
            show_default=True,
            metavar="SECONDS",
            help="Longest time of a method on a field; beyond it, it fails on that field. 0: no limit.",
        ),
        click.option(
            "--dashboard",
            type=click.IntRange(1, 65535),
            is_flag=False,
            flag_value=8787,
            metavar="[PORT]",
            help="Serve dask's dashboard on loopback, default port 8787 (needs bokeh).",
        ),
        click.option("--scheduler-file", type=PATH, metavar="FILE", help="Scheduler file of an existing dask cluster."),
        click.option("--scheduler", metavar="ADDR", help="Address of an existing dask scheduler, tcp://host:port."),
        click.option("--serial", is_flag=True, help="No workers: everything in this process."),
        click.option("--workers", type=int, metavar="N", help="Local worker processes.  [default: all cores]"),
    ):
        wrapped = option(wrapped)
    return cast(F, wrapped)


def refuse_overwriting(targets: Sequence[Path], sources: Sequence[Path | None]) -> None:
    """Raise `BadInput` if a file to write is one of those that are read, or is named twice."""
    for number, target in enumerate(targets):
        if target.exists() and any(s is not None and s.exists() and target.samefile(s) for s in sources):
            raise BadInput(str(target), "is one of the files to read; give another name to write to")
        if target.absolute() in [other.absolute() for other in targets[:number]]:
            raise BadInput(str(target), "is named twice; each file to write needs a name of its own")


def print_json(content: Any) -> None:
    """One JSON document on stdout."""
    click.echo(json.dumps(content, indent=1, default=str))


def human_bytes(size: float) -> str:
    """A number of bytes as a person reads it."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} TB"


def human_time(seconds: float) -> str:
    """A duration as a person reads it."""
    if seconds < 90.0:
        return f"{seconds:.3g} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.1f} min"
    return f"{seconds / 3600.0:.1f} h"


def human_rate(fields_per_s: float) -> str:
    """A rate of fields as a person reads it."""
    return f"{fields_per_s:.3g} fields/s" if fields_per_s >= 1.0 else f"{60.0 * fields_per_s:.3g} fields/min"
