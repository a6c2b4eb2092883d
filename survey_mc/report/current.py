"""Whether a report is as new as its run, told without making one."""

from __future__ import annotations

from pathlib import Path

from survey_mc.store import RunLayout


def current_report(run_dir: Path | str) -> Path | None:
    """The page of a report that is as new as what it was made of; None if there is none.

    The list of its digests is written after everything else, and manifest and lock file only where they change.
    """
    layout = RunLayout(Path(run_dir))
    page = layout.report / "index.html"
    try:
        made_of = max(path.stat().st_mtime_ns for path in (layout.manifest, layout.lock_file))
        is_newer = layout.digests.stat().st_mtime_ns > made_of
    except OSError:
        return None
    return page if is_newer and page.is_file() else None
