"""Progress on stderr: a bar on a terminal, a line every few seconds in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from survey_mc.cli.options import human_rate, human_time
from survey_mc.cli.say import say
from survey_mc.run import Progress

SECONDS_BETWEEN_LINES = 5.0


@contextmanager
def show_progress(name: str) -> Iterator[Callable[[Progress], None]]:
    """A function to call with the state of the run after each task."""
    if sys.stderr.isatty():
        yield from _bar(name)
    else:
        yield _Lines(name)


def _remarks(state: Progress) -> str:
    """What has failed, and whether anybody is at work."""
    failed = "".join(f", {number} failed in {method}" for method, number in sorted(state.failures.items()))
    return failed + ("" if state.workers else ", waiting for workers")


def _say_dashboard(state: Progress, told: set[str]) -> None:
    if state.dashboard and state.dashboard not in told:
        told.add(state.dashboard)
        click.echo(f"dask dashboard: {state.dashboard}", err=True)


def _bar(name: str) -> Iterator[Callable[[Progress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("fields"),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[remarks]}"),
    )
    begun_s = time.monotonic()
    told: set[str] = set()
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(name, total=None, rate="", remarks="")

        def show(state: Progress) -> None:
            _say_dashboard(state, told)
            rate = human_rate(state.done / (time.monotonic() - begun_s)) if state.done else ""
            bar.update(task, completed=state.done, total=state.total, rate=rate, remarks=_remarks(state))

        yield show


class _Lines:
    """One line every few seconds, and one at the end."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.begun_s = self.last_s = time.monotonic()
        self.told: set[str] = set()

    def __call__(self, state: Progress) -> None:
        _say_dashboard(state, self.told)
        now = time.monotonic()
        if state.done < state.total and now - self.last_s < SECONDS_BETWEEN_LINES:
            return
        self.last_s = now
        elapsed_s = now - self.begun_s
        text = f"{self.name}: {state.done}/{state.total} fields, {human_time(elapsed_s)}"
        if state.done:
            left_s = elapsed_s / state.done * (state.total - state.done)
            text += f", {human_rate(state.done / elapsed_s)}, {human_time(left_s)} left"
        click.echo(text + _remarks(state), err=True)


def show_files(run: Path) -> Callable[[str], None]:
    """A function to call before each file of a run directory: a line every few seconds."""
    begun_s = last_s = time.monotonic()
    n_done = 0

    def show(path: str) -> None:
        nonlocal last_s, n_done
        now = time.monotonic()
        if now - last_s >= SECONDS_BETWEEN_LINES:
            last_s = now
            say(f"{run}: {n_done} files done, {human_time(now - begun_s)}", err=True)
        n_done += 1

    return show
