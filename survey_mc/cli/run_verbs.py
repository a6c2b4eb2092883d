"""Verbs that take a run directory: status, report, verify, replay."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from survey_mc.cli.options import executor_options, human_rate, human_time, json_option, print_json, run_argument
from survey_mc.cli.say import say
from survey_mc.errors import EXIT_DAMAGED_STORE, EXIT_FAILED_TASKS

if TYPE_CHECKING:
    from survey_mc.run import FieldLimits
    from survey_mc.run.executors import ExecutorChoice
    from survey_mc.run.status.state import RunStatus


@click.command()
@run_argument
@click.option(
    "--watch",
    type=click.FloatRange(0.5, 3600.0),
    is_flag=False,
    flag_value=5.0,
    metavar="[SECONDS]",
    help="Say it again every few seconds, default 5, until nobody is at work on the run.",
)
@json_option
def status(run: Path, watch: float | None, as_json: bool) -> int:
    """Say what is done, how fast it goes on, what failed (the first errors) and what was skipped (with the reason)."""
    from survey_mc.run.status.state import run_status

    state = run_status(run)
    while watch is not None and state.last_run.at_work and state.done < state.wanted:
        _print_status(state, as_json)
        time.sleep(watch)
        state = run_status(run)
        click.echo()
    _print_status(state, as_json)
    return EXIT_FAILED_TASKS if state.n_failed else 0


def _print_status(state: RunStatus, as_json: bool) -> None:
    if as_json:
        print_json(state.as_dict())
        return
    say(f"{state.root}: {state.done} of {state.wanted} (field, method) pairs done, {state.n_failed} failed")
    last = state.last_run
    if last.at_work:
        rate = "" if last.fields_per_s is None else f", {human_rate(last.fields_per_s)}"
        left = "" if last.left_s is None else f", {human_time(last.left_s)} left"
        say(f"  {last.at_work} is at work: {last.done} of {last.fields} fields{rate}{left}")
    for cell, method, done, wanted in state.rows:
        say(f"  {cell} / {method}: {done} of {wanted}")
    if state.cpu_s:
        spent = (f"{name or 'drawing'} {human_time(seconds)}" for name, seconds in state.cpu_s.items())
        say(f"  CPU so far: {', '.join(spent)}")
    shown = state.first_failures[:10]
    for failure in shown:
        place = f"{failure['cell']} / {failure['method'] or 'drawing'} / realisation {failure['realisation']}"
        more = f", the first of {failure['n']}" if failure["n"] > 1 else ""
        say(f"  failed ({failure['cause']}{more}): {place}: {failure['error']}")
        say(f"          {failure['replay']}")
    if state.n_failed > len(shown):
        say(f"  {state.n_failed} in all (--json lists them)")
    for reason, number in state.skips.items():
        say(f"  skipped {number} times: {reason}")


@click.command()
@run_argument
def report(run: Path) -> None:
    """Make tables, figures and report/index.html (also made at the end of `run`)."""
    from survey_mc.report import make_report

    say(f"Report: {make_report(run)}")


@click.command()
@run_argument
@click.option(
    "--replay", "n_replay", type=click.IntRange(0), default=0, metavar="N", help="Compute N random fields again."
)
@click.option("--seed", default=0, show_default=True, metavar="S", help="Chooses the replayed fields.")
@click.option("--repair", is_flag=True, help="Remove what is damaged and compute it again.")
@executor_options
@json_option
def verify(
    run: Path,
    n_replay: int,
    seed: int,
    repair: bool,
    executor: ExecutorChoice,
    limits: FieldLimits,
    as_json: bool,
) -> int:
    """Check every file (checksum, schema, rows, strays); compute random fields again and compare to the last bit."""
    from survey_mc.cli.progress import show_files
    from survey_mc.run import verify_run

    result = verify_run(
        run,
        n_replay,
        repair=repair,
        seed=seed,
        executor=executor,
        limits=limits,
        remake_report=_remake_report,
        on_file=show_files(run),
    )
    if as_json:
        print_json(
            {
                "files": result.files,
                "damages": [{"kind": d.kind, "path": d.path, "about": d.about} for d in result.damages],
                "replayed": [{"cell": c, "method": m, "realisation": r} for c, m, r in result.replayed],
                "differences": result.differences,
                "repaired": result.repaired is not None,
                "lacking": result.lacking,
            }
        )
    else:
        for damage in result.damages:
            say(f"{'left over' if damage.kind == 'leftover' else 'damaged'}: {damage.path}: {damage.about}")
        for sentence in result.differences:
            say(f"differs: {sentence}")
        say(
            f"{result.files} files checked, {result.n_damaged} damaged"
            + (
                f"; {len(result.replayed)} fields computed again, {len(result.differences)} tables differ"
                if n_replay
                else ""
            )
            + ("; repaired" if result.repaired is not None else "")
        )
        if result.lacking:
            say(f"{result.lacking} (field, method) pairs of the campaign are not stored; `survey-mc status` says why")
        if result.n_damaged and not repair:
            say(f"Repair: survey-mc verify {shlex.quote(str(run))} --repair", err=True)
    return 0 if result.sound or result.mended else EXIT_DAMAGED_STORE


def _remake_report(run: Path) -> None:
    from survey_mc.report import remake_report  # loads pandas, which a sound run does without

    remake_report(run)


@click.command()
@run_argument
@click.option("--cell", default=0, show_default=True, metavar="I", help="Cell number.")
@click.option("--realisation", default=0, show_default=True, metavar="J", help="Realisation number.")
@click.option("--method", "label", metavar="LABEL", help="Label of the method.  [default: all]")
def replay(run: Path, cell: int, realisation: int, label: str | None) -> None:
    """Do one field of a run again, in this process, with full tracebacks; stores nothing."""
    from survey_mc.campaign import load_run_campaign
    from survey_mc.run.simulate import pick_cell
    from survey_mc.run.simulate import replay as replay_one

    campaign = load_run_campaign(run)
    place = pick_cell(campaign, cell)
    for chosen in [m.label for m in place.methods] if label is None else [label]:
        again = replay_one(campaign, place, chosen, realisation)
        found = again.matched.matches
        statuses = found[found["rule"] == campaign.match.rule]["status"].value_counts().sort_index()
        text = ", ".join(f"{number} {name}" for name, number in statuses.items())
        where = f"{place.label} / {chosen} / realisation {realisation}"
        say(f"{where}: {len(again.detections)} detections: {text}")


RUN_VERBS = (status, report, verify, replay)
