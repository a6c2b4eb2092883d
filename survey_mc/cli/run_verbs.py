"""Verbs that take a run directory: status, report, verify, replay."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from survey_mc.cli.options import executor_options, json_option, print_json, run_argument
from survey_mc.errors import EXIT_DAMAGED_STORE, EXIT_FAILED_TASKS

if TYPE_CHECKING:
    from survey_mc.run import FieldLimits
    from survey_mc.run.executors import ExecutorChoice


@click.command()
@run_argument
@json_option
def status(run: Path, as_json: bool) -> int:
    """Say what is done, what failed (with the first error) and what was skipped (with the reason)."""
    from survey_mc.run.status import run_status

    state = run_status(run)
    if as_json:
        print_json(state.as_dict())
    else:
        click.echo(f"{state.root}: {state.done} of {state.wanted} (field, method) pairs done, {state.n_failed} failed")
        for cell, method, done, wanted in state.rows:
            click.echo(f"  {cell} / {method}: {done} of {wanted}")
        for failure in state.failures[:10]:
            click.echo(f"  failed: {failure['cell']} / {failure['method'] or 'drawing'} / realisation "
                       f"{failure['realisation']}: {failure['error']}")  # fmt: skip
            click.echo(f"          {failure['replay']}")
        if len(state.failures) > 10:
            click.echo(f"  … and {len(state.failures) - 10} more (--json lists them)")
        for reason, number in state.skips.items():
            click.echo(f"  skipped {number} times: {reason}")
    return EXIT_FAILED_TASKS if state.n_failed else 0


@click.command()
@run_argument
def report(run: Path) -> None:
    """Make tables, figures and report/index.html (also made at the end of `run`)."""
    from survey_mc.report import make_report

    click.echo(f"Report: {make_report(run)}")


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
    from survey_mc.run import verify_run

    result = verify_run(run, n_replay, repair=repair, seed=seed, executor=executor)
    if as_json:
        print_json(
            {
                "files": result.files,
                "damages": [{"kind": d.kind, "path": d.path, "about": d.about} for d in result.damages],
                "replayed": [{"cell": c, "method": m, "realisation": r} for c, m, r in result.replayed],
                "differences": result.differences,
                "repaired": result.repaired is not None,
            }
        )
    else:
        for damage in result.damages:
            click.echo(f"{'left over' if damage.kind == 'leftover' else 'damaged'}: {damage.path}: {damage.about}")
        for sentence in result.differences:
            click.echo(f"differs: {sentence}")
        click.echo(
            f"{result.files} files checked, {result.n_damaged} damaged"
            + (
                f"; {len(result.replayed)} fields computed again, {len(result.differences)} tables differ"
                if n_replay
                else ""
            )
            + ("; repaired" if result.repaired is not None else "")
        )
        if result.n_damaged and not repair:
            click.echo(f"Repair: survey-mc verify {shlex.quote(str(run))} --repair", err=True)
    mended = result.repaired is not None and result.repaired.complete and not result.differences
    return 0 if result.sound or mended else EXIT_DAMAGED_STORE


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
        click.echo(f"{where}: {len(again.detections)} detections: {text}")


RUN_VERBS = (status, report, verify, replay)
