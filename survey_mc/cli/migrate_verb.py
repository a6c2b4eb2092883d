"""`survey-mc migrate`: bring what an older version stored to the present one."""

from __future__ import annotations

from pathlib import Path

import click

from survey_mc.cli.options import json_option, print_json, run_argument


@click.command()
@run_argument
@json_option
def migrate(run: Path, as_json: bool) -> None:
    """Rewrite what an older version stored as this one stores it; no row and no value is lost."""
    from survey_mc.cli.progress import show_files
    from survey_mc.store import migrate_run

    done = migrate_run(run, show_files(run))
    if as_json:
        print_json({"files": done.files, "rewritten": done.rewritten, "lock": done.lock})
    else:
        lock = "lock file rewritten" if done.lock else "lock file up to date"
        click.echo(f"{done.files} files, {done.rewritten} of an older version rewritten; {lock}")
        if done.rewritten:
            click.echo("Next: survey-mc report, whose tables are made of the rows as they are now", err=True)
