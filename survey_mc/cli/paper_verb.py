"""The verb that runs the whole study of Valtchanov, Pierre & Gastaud 2001 again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from survey_mc.cli.options import PATH, executor_options, json_option, print_json
from survey_mc.errors import EXIT_FAILED_TASKS

if TYPE_CHECKING:
    from survey_mc.run import FieldLimits
    from survey_mc.run.executors import ExecutorChoice


@click.command()
@click.option(
    "--realisations", type=int, metavar="N", help="Fields of each cell where the paper has ten.  [default: 10]"
)
@click.option(
    "--images",
    type=int,
    metavar="M",
    help="Images of Tests 1, 2 and 4, where the paper has one.  [default: 1, or 4 N where N is more than 10]",
)
@click.option(
    "--out", type=PATH, metavar="DIR", help="Folder of the study.  [default: results/valtchanov2001]", default=None
)
@click.option(
    "--campaigns", type=PATH, metavar="DIR", help="Folder of the campaign files.  [default: campaigns]", default=None
)
@click.option(
    "--options/--no-options",
    "with_options",
    default=None,
    help="Run the campaigns that measure what named choices do.  [default: with at least 39 fields and images; fewer "
    "decide nothing]",
)
@click.option(
    "--check", type=PATH, metavar="LOCK", help="Compare what comes out with the study.lock.json of another study."
)
@executor_options
@json_option
def paper(
    realisations: int | None,
    images: int | None,
    out: Path | None,
    campaigns: Path | None,
    with_options: bool | None,
    check: Path | None,
    executor: ExecutorChoice,
    limits: FieldLimits,
    as_json: bool,
) -> int:
    """Reproduce Valtchanov, Pierre & Gastaud 2001: run its tests, compare every published number, draw every figure.

    Without options it has the paper's own numbers of images. Started again, it does what is missing; a study of another
    size in the same folder is shrunk or grown. Exit code 3 if a field failed or --check finds a difference.
    """
    from survey_mc.cli.progress import show_progress
    from survey_mc.paper import StudyResults, StudySize, report_study, run_study
    from survey_mc.paper.reproduce import DEFAULT_CAMPAIGNS, DEFAULT_OUT
    from survey_mc.paper.study_lock import differences, read_study_lock

    lock = read_study_lock(check) if check is not None else None
    done = run_study(
        StudySize.of(realisations, images),
        out or DEFAULT_OUT,
        campaigns or DEFAULT_CAMPAIGNS,
        executor,
        limits=limits,
        with_options=with_options,
        show_progress=show_progress,
    )
    page = report_study(done.root)
    failed = sum(run.failed for run in done.runs.values())
    unlike = differences(lock, StudyResults(done.root)) if lock is not None else []
    if as_json:
        facts = {"study": str(done.root), "fields": done.fields, "failed": failed, "report": str(page)}
        print_json(facts | ({"differences": unlike} if lock is not None else {}))
    else:
        click.echo(f"{done.root}: {done.fields} fields done in {len(done.runs)} campaigns; {failed} failed.")
        click.echo(f"Scorecard: {done.root / 'scorecard.csv'}")
        click.echo(f"Report: {page}")
        for line in unlike:
            click.echo(line)
        if lock is not None:
            click.echo(f"{check}: {f'{len(unlike)} differences' if unlike else 'the same results'}")
    return EXIT_FAILED_TASKS if unlike or not done.complete else 0
