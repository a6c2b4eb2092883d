"""The pictures of one field, drawn in a process of their own.

Idea     a field and the images that the procedures search take the compiler and up to 250 MB, ten times what the tables
         of any number of fields take; and a procedure that crashes there takes no report with it.
Limits   a process that has loaded the compiler already, because it draws fields itself, draws this one too.
"""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass
from pathlib import Path

import survey_mc
from survey_mc.campaign import Campaign, load_run_campaign
from survey_mc.report.figures.style import Figure
from survey_mc.store import RunData

COMPILER = "numba"
SECONDS_ALLOWED = 600.0
LAST_WORDS = 300


@dataclass(frozen=True, slots=True)
class FieldFigures:
    """Pictures of one field; problem: why there are none although they were wanted, without a full stop."""

    figures: tuple[Figure, ...]
    problem: str = ""


def one_field_figures(data: RunData, campaign: Campaign) -> FieldFigures:
    """The pictures of the first field for which every method has a result; none without such a field."""
    if COMPILER in sys.modules or not sys.executable:
        try:
            return FieldFigures(_draw(data, campaign))
        except Exception as problem:  # of a procedure's view: the tables are no worse for it
            return FieldFigures((), f"{type(problem).__name__}: {problem}"[:LAST_WORDS])
    package = str(Path(survey_mc.__file__).parents[1])
    path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
    command = [sys.executable, "-P", "-m", __name__, str(data.layout.root.absolute())]
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=SECONDS_ALLOWED, env={**os.environ, "PYTHONPATH": path}
        )
    except subprocess.TimeoutExpired:
        return FieldFigures((), f"it took longer than {SECONDS_ALLOWED:g} seconds")
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().rsplit("\n", 1)[-1]
        return FieldFigures((), words[:LAST_WORDS] or f"the process ended with {done.returncode}")
    return FieldFigures(tuple(_unpacked(line) for line in done.stdout.splitlines() if line.startswith(b"{")))


def _draw(data: RunData, campaign: Campaign) -> tuple[Figure, ...]:
    from survey_mc.report.figures.pictures import field_figures
    from survey_mc.report.one_field import field_picture

    picture = field_picture(data, campaign)
    return tuple(field_figures(picture)) if picture is not None else ()


def _packed(figure: Figure) -> str:
    return json.dumps(asdict(figure) | {"png": base64.b64encode(figure.png).decode("ascii")})


def _unpacked(line: bytes) -> Figure:
    content = json.loads(line)
    return Figure(**content | {"png": base64.b64decode(content["png"]), "tables": tuple(content["tables"])})


def main(run_dir: Path) -> None:
    """Print the pictures of a run directory, one JSON object a line."""
    with redirect_stdout(sys.stderr):  # whatever a procedure has to say
        figures = _draw(RunData(run_dir), load_run_campaign(run_dir))
    for figure in figures:
        print(_packed(figure))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
