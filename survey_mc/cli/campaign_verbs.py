"""Verbs that take a campaign file: validate, plan, run, simulate."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from survey_mc.cli.options import (
    PATH,
    campaign_argument,
    executor_options,
    human_bytes,
    human_time,
    json_option,
    out_option,
    print_json,
    refuse_overwriting,
)
from survey_mc.cli.say import say
from survey_mc.errors import EXIT_FAILED_TASKS

if TYPE_CHECKING:
    from survey_mc.run import FieldLimits, RunSummary
    from survey_mc.run.executors import ExecutorChoice


@click.command()
@campaign_argument
@json_option
def validate(campaign: Path, as_json: bool) -> None:
    """Check a campaign file and print what it expands to; touch nothing."""
    from survey_mc.campaign import expand, load_campaign

    loaded = load_campaign(campaign)
    cells = expand(loaded)
    if as_json:
        print_json({"campaign": loaded.model_dump(mode="json", by_alias=True), "cells": [c.label for c in cells]})
        return
    say(f"{campaign}: good. {loaded.name}: {loaded.about}")
    say(f"sky {loaded.sky.kind}, seed {loaded.seed}, {loaded.grid.realisations} realisations of {len(cells)} cells:")
    for cell in cells:
        say(f"  {cell.index}  {cell.label}  (input list: more than {cell.counts_min:g} counts)")
    for choice in loaded.method:
        given = ", ".join(f"{k} = {v!r}" for k, v in choice.params.model_dump().items())
        say(f"  method {choice.label} ({choice.name}): {given}")


@click.command()
@campaign_argument
@out_option
@click.option(
    "--workers", type=click.IntRange(1, 1024), metavar="N", help="Workers to predict for.  [default: all cores]"
)
@json_option
def plan(campaign: Path, out: Path | None, workers: int | None, as_json: bool) -> None:
    """Say what a run would do: tasks, done and to do, expected CPU time and bytes. Writes nothing."""
    from survey_mc.campaign import load_campaign
    from survey_mc.run import plan_campaign
    from survey_mc.run.executors import usable_cores

    n_workers = workers or usable_cores()
    planned = plan_campaign(load_campaign(campaign), out, n_workers)
    wall_s = planned.wall_s(n_workers)
    if as_json:
        cells: list[dict[str, Any]] = [
            {"label": c.label, "fields": c.fields, "to_do": c.to_do, "cpu_s": c.cpu_s, "bytes": c.size_bytes}
            for c in planned.cells
        ]
        print_json(
            {
                "run": str(planned.root),
                "fields": planned.fields,
                "to_do": planned.to_do,
                "tasks": planned.orders,
                "fields_per_task": planned.block,
                "files": planned.files,
                "cpu_s": planned.cpu_s,
                "wall_s": wall_s,
                "workers": n_workers,
                "bytes": planned.size_bytes,
                "measured": planned.measured,
                "problems": list(planned.problems),
                "cells": cells,
            }
        )
        return
    say(f"{planned.root}: {planned.fields} fields, {planned.fields - planned.to_do} done, {planned.to_do} to do")
    for cell in planned.cells:
        say(
            f"  {cell.label}: {cell.fields - cell.to_do} of {cell.fields} done; to do: "
            f"{human_time(cell.cpu_s)} of CPU, {human_bytes(cell.size_bytes)}"
        )
    for problem in planned.problems:
        say(f"  fails on the first field: {problem}")
    say(
        f"{planned.orders} tasks of up to {planned.block} field{'s' * (planned.block != 1)}; about "
        f"{human_time(planned.cpu_s)} of CPU, {human_time(wall_s)} with {n_workers} workers, "
        f"{human_bytes(planned.size_bytes)} in {planned.files} files "
        f"when complete (costs from: {planned.measured})"
    )


@click.command()
@campaign_argument
@out_option
@executor_options
@click.option("--retry-failed", is_flag=True, help="Try again what failed or was skipped in an earlier run.")
@click.option(
    "--block", type=click.IntRange(1, 10_000), metavar="N", help="Fields in one task; no result depends on it."
)
@click.option("--no-report", is_flag=True, help="Leave tables and report to `survey-mc report`.")
@json_option
def run(
    campaign: Path,
    out: Path | None,
    executor: ExecutorChoice,
    limits: FieldLimits,
    retry_failed: bool,
    block: int | None,
    no_report: bool,
    as_json: bool,
) -> int:
    """Simulate, detect, match, and make tables and a report. Started again, it does what is missing."""
    from survey_mc.campaign import load_campaign
    from survey_mc.cli.progress import show_progress
    from survey_mc.run import run_campaign

    loaded = load_campaign(campaign)
    with show_progress(loaded.name) as on_progress:
        done = run_campaign(
            loaded, out, executor, block=block, retry_failed=retry_failed, limits=limits, on_progress=on_progress
        )
    page = None
    if not no_report:
        page = _page_of(done)
    if as_json:
        print_json(
            {
                "run": str(done.root),
                "fields": done.fields,
                "failed": done.failed,
                "skipped": done.skipped,
                "causes": done.causes,
                "report": str(page) if page else None,
            }
        )
    else:
        _print_summary(campaign, done, page)
    return 0 if done.complete else EXIT_FAILED_TASKS


def _page_of(done: RunSummary) -> Path:
    """The report of a run, made again unless nothing has changed since it was made."""
    if done.fields == 0:
        from survey_mc.report import current_report

        page = current_report(done.root)
        if page is not None:
            return page
    from survey_mc.report import make_report  # loads pandas, which a finished run does without

    return make_report(done.root)


def _print_summary(campaign: Path, done: RunSummary, page: Path | None) -> None:
    if done.fields == 0 and not done.failed:
        say(f"{done.root}: nothing to do, everything is stored.")
    else:
        causes = ", ".join(f"{number} {cause}" for cause, number in sorted(done.causes.items()))
        say(
            f"{done.root}: {done.fields} fields done; {done.failed} (field, method) pairs in quarantine"
            f"{f' ({causes})' if causes else ''}, {done.skipped} skipped."
        )
    if done.failed:
        where, what = shlex.quote(str(done.root)), shlex.quote(str(campaign))
        say(f"Causes: survey-mc status {where}   Retry: survey-mc run {what} --retry-failed --out {where}")
    if page is not None:
        say(f"Report: {page}")


@click.command()
@campaign_argument
@click.option("--cell", default=0, show_default=True, metavar="I", help="Cell number, see `survey-mc validate`.")
@click.option("--realisation", default=0, show_default=True, metavar="J", help="Realisation number.")
@click.option("--out", type=PATH, required=True, metavar="FIELD.fits", help="File to write.")
@click.option("--overwrite", is_flag=True, help="Replace the file if it exists.")
def simulate(campaign: Path, cell: int, realisation: int, out: Path, overwrite: bool) -> None:
    """Write one field of a campaign as FITS: counts, exposure and background images, photons, truth."""
    from survey_mc.campaign import load_campaign
    from survey_mc.fits import write_simulated_field
    from survey_mc.run import simulate_field
    from survey_mc.run.simulate import pick_cell

    refuse_overwriting((out,), (campaign,))
    loaded = load_campaign(campaign)
    place = pick_cell(loaded, cell)
    field = simulate_field(loaded, cell, realisation)
    facts = {"campaign": loaded.name, "seed": loaded.seed, "cell": place.label, "realisation": realisation}
    write_simulated_field(
        out,
        field,
        pointing_deg=loaded.instrument.pointing_deg or (0.0, 0.0),
        instrument=place.instrument,
        parameters=facts,
        overwrite=overwrite,
    )
    n_photons = int(field.observation.counts.sum())
    say(f"{out}: {place.label}, realisation {realisation}: {n_photons} photons, {len(field.truth)} true sources")


CAMPAIGN_VERBS = (validate, plan, run, simulate)
