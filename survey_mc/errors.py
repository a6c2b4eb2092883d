"""The errors a person can act on: what is wrong, where, what was found, what is allowed.

Idea     everything raised at a border is a `SurveyError`; the command line prints its sentence and its exit code.
Limits   errors inside the science are ordinary exceptions: they are bugs, and are journalled with their traceback.
"""

from __future__ import annotations

EXIT_BAD_INPUT = 2
EXIT_FAILED_TASKS = 3
EXIT_DAMAGED_STORE = 4
EXIT_LOCKED = 5
EXIT_INTERRUPTED = 130  # Ctrl-C
EXIT_TERMINATED = 143  # SIGTERM, as batch systems send it before they kill


class SurveyError(Exception):
    """One sentence for the person who can act; `exit_code` is what the command line returns."""

    exit_code = EXIT_BAD_INPUT


class BadInput(SurveyError):
    """A campaign, an image or an option that cannot be used.

    where: file and place ("deep.toml: grid.exposure_ks[1]"); problem: what is allowed and what was found.
    """

    def __init__(self, where: str, problem: str) -> None:
        super().__init__(f"{where}: {problem}")


class DamagedStore(SurveyError):
    """A file of a run is not what the manifest says it is."""

    exit_code = EXIT_DAMAGED_STORE


class RunLocked(SurveyError):
    """Another process writes to this run directory."""

    exit_code = EXIT_LOCKED
