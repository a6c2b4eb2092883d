"""The verb that runs the whole study of Valtchanov, Pierre & Gastaud 2001 again."""

from __future__ import annotations

from pathlib import Path

import click

from survey_mc.cli.options import PATH, executor_options, json_option, print_json
from survey_mc.errors import EXIT_FAILED_TASKS


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
@click.option("--no-options", is_flag=True, help="Leave out the campaigns that measure the effects of named choices.")
@executor_options
@json_option
def paper(
    realisations: int | None,
    images: int | None,
    out: Path | None,
    campaigns: Path | None,
    no_options: bool,
    workers: int | None,
    serial: bool,
    scheduler: str | None,
    scheduler_file: Path | None,
    as_json: bool,
) -> int:
    """Reproduce Valtchanov, Pierre & Gastaud 2001: run its tests, compare every published number, draw every figure.

    Without options it has the paper's own numbers of images. Started again, it does what is missing.
    """
    from survey_mc.cli.progress import show_progress
    from survey_mc.paper import StudySize, report_study, run_study
    from survey_mc.paper.reproduce import DEFAULT_CAMPAIGNS, DEFAULT_OUT
    from survey_mc.run.executors import ExecutorChoice

    done = run_study(
        StudySize.of(realisations, images),
        out or DEFAULT_OUT,
        campaigns or DEFAULT_CAMPAIGNS,
        ExecutorChoice(serial, workers, scheduler, scheduler_file),
        with_options=not no_options,
        show_progress=show_progress,
    )
    page = report_study(done.root)
    failed = sum(run.failed + run.quarantined for run in done.runs.values())
    if as_json:
        print_json({"study": str(done.root), "fields": done.fields, "failed": failed, "report": str(page)})
    else:
        click.echo(f"{done.root}: {done.fields} fields done in {len(done.runs)} campaigns; {failed} failed.")
        click.echo(f"Scorecard: {done.root / 'scorecard.csv'}")
        click.echo(f"Report: {page}")
    return 0 if done.complete else EXIT_FAILED_TASKS
