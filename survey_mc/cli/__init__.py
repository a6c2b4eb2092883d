"""The command line: verbs become calls, answers are printed, errors become one sentence and an exit code."""

from survey_mc.cli.main import main

__all__ = ["main"]
