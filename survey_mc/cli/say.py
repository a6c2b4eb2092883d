"""What the commands say."""

from __future__ import annotations

import click

from survey_mc.shown import shown


def say(line: str, *, err: bool = False) -> None:
    """Print a line; names and messages in it may be those of a stranger's run."""
    click.echo(shown(line), err=err)
