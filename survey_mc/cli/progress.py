"""Progress on stderr: a bar on a terminal, a line every few seconds in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

from survey_mc.cli.options import human_time
from survey_mc.run.engine import Progress

SECONDS_BETWEEN_LINES = 5.0


@contextmanager
def show_progress(name: str) -> Iterator[Callable[[Progress], None]]:
    """A function to call with the state of the run after each task."""
    if sys.stderr.isatty():
        yield from _bar(name)
    else:
        yield _Lines(name)


def _failures(state: Progress) -> str:
    return "".join(f", {number} failed in {method}" for method, number in sorted(state.failures.items()))


def _bar(name: str) -> Iterator[Callable[[Progress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("fields"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failures]}"),
    )
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(name, total=None, failures="")
        yield lambda state: bar.update(task, completed=state.done, total=state.total, failures=_failures(state))


class _Lines:
    """One line every few seconds, and one at the end."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.begun_s = self.last_s = time.monotonic()

    def __call__(self, state: Progress) -> None:
        now = time.monotonic()
        if state.done < state.total and now - self.last_s < SECONDS_BETWEEN_LINES:
            return
        self.last_s = now
        elapsed_s = now - self.begun_s
        left = f", {human_time(elapsed_s / state.done * (state.total - state.done))} left" if state.done else ""
        text = f"{self.name}: {state.done}/{state.total} fields, {human_time(elapsed_s)}{left}{_failures(state)}"
        click.echo(text, err=True)
