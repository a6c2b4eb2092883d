"""What to say when a run directory cannot be written."""

from __future__ import annotations

import errno
import shutil

from survey_mc.errors import SurveyError
from survey_mc.store import RunData, RunLayout

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_DISK_PROBLEMS = _FULL | {errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.ESTALE, errno.ENAMETOOLONG}


def is_disk_problem(problem: OSError) -> bool:
    """Whether an error is the disk's and not ours."""
    return problem.errno in _DISK_PROBLEMS or isinstance(problem, NotADirectoryError | FileExistsError)


def disk_sentence(layout: RunLayout, problem: OSError) -> str:
    """Where, why, how much space there is and how much is wanted, and what becomes of the results."""
    room = _room(layout) if problem.errno in _FULL else ""
    return (
        f"{layout.root}: cannot be written: {problem.strerror or problem}{room}; what is stored is safe, and the same "
        "command goes on from there"
    )


def _room(layout: RunLayout) -> str:
    free = shutil.disk_usage(layout.root).free
    needed = _bytes_needed(layout)
    wanted = "" if needed is None else f", the rest of the run needs about {needed} bytes"
    return f" ({free} bytes are free{wanted})"


def _bytes_needed(layout: RunLayout) -> int | None:
    """Bytes of what is missing, judged by what is stored; None if nothing is."""
    try:
        data = RunData(layout.root)
    except (SurveyError, OSError):
        return None
    done = wanted = 0
    for cell in data.cells:
        for label in cell.match_keys:
            wanted += cell.realisations
            done += data.realisations_done("matches", cell.label, label)
    stored = sum(record.size_bytes for record in data.manifest)
    return None if not done else int(stored / done * (wanted - done))
