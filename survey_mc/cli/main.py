"""Entry point of `survey-mc`.

Idea     results go to stdout, progress and sentences to stderr. Exit codes: 0 done, 2 bad input or usage, 3 finished
         with failed or quarantined fields, 4 store damaged, 5 run directory locked, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

import click

from survey_mc import __version__
from survey_mc.cli.campaign_verbs import CAMPAIGN_VERBS
from survey_mc.cli.detector_verbs import check_detector
from survey_mc.cli.image_verbs import IMAGE_VERBS
from survey_mc.cli.migrate_verb import migrate
from survey_mc.cli.paper_verb import paper
from survey_mc.cli.run_verbs import RUN_VERBS
from survey_mc.cli.say import say
from survey_mc.cli.show import show
from survey_mc.cli.stellarity_verbs import STELLARITY_VERBS
from survey_mc.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_TERMINATED, BadInput, SurveyError


class _InOrder(click.Group):
    """Lists the verbs in the order of use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(cls=_InOrder, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="survey-mc")
def cli() -> None:
    """Monte-Carlo completeness of X-ray source surveys: simulate, detect, match, measure.

    Start with:  survey-mc run campaigns/smoke.toml
    """


for verb in (*CAMPAIGN_VERBS, *RUN_VERBS, migrate, *IMAGE_VERBS, *STELLARITY_VERBS, paper, show, check_detector):
    cli.add_command(verb)


_received: list[int] = []  # click turns the exception of a signal into one of its own that does not tell which


def _interrupt(number: int, frame: FrameType | None) -> None:
    _received.append(number)
    raise KeyboardInterrupt


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit code; a `SurveyError` is printed as its one sentence."""
    signal.signal(signal.SIGTERM, _interrupt)
    # Arrow's own heap would be one beside that of everything else, of 20 MB.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    try:
        _refuse_undecodable(sys.argv[1:] if arguments is None else arguments)
        code = cli.main(args=arguments, prog_name="survey-mc", standalone_mode=False)
    except click.ClickException as problem:
        problem.show()
        code = problem.exit_code
    except SurveyError as problem:
        _say(str(problem))
        code = problem.exit_code
    except (KeyboardInterrupt, click.Abort):
        _say("interrupted; what is finished is stored, and the same command goes on from there")
        code = EXIT_TERMINATED if signal.SIGTERM in _received else EXIT_INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        code = 0
    except OSError as problem:
        _say(f"{problem.filename or 'input or output'}: {problem.strerror or problem}")
        code = EXIT_BAD_INPUT
    if arguments is None:
        # The work is over and its exit code known: what comes while the interpreter ends comes too late.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
    sys.exit(code if isinstance(code, int) else 0)


def _refuse_undecodable(arguments: list[str]) -> None:
    """Names of files go into JSON, FITS and Parquet, which hold UTF-8 only."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise BadInput(ascii(argument)[:200], "is not UTF-8 text") from None


def _say(sentence: str) -> None:
    """One line on stderr; control characters, which a file or a file name may hold, do not reach the terminal."""
    say(f"survey-mc: {sentence}", err=True)
