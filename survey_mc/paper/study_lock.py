"""The lock of a study: how large it is, what it was made with, and the SHA-256 of what came out.

Idea     `survey-mc paper --check study.lock.json` makes the study again and says whether the same came out. CPU times
         and pictures, which depend on the machine or its fonts, are not in it.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from survey_mc.errors import BadInput
from survey_mc.fits.writing import write_whole
from survey_mc.paper.results import StudyResults

LOCK_SCHEMA = 2
PUBLISHED_TABLES = ("scorecard.csv", "option_effects.csv")


def write_study_lock(results: StudyResults, path: Path) -> None:
    """Write the lock of a study whose tables and scorecard are made."""
    content = {
        "lock_schema": LOCK_SCHEMA,
        "command": _command(results),
        "runs": {campaign.name: _run(results, campaign.name) for campaign in results.campaigns},
        "results_sha256": results_sha256(results),
    }
    write_whole(path, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode(), overwrite=True)


def results_sha256(results: StudyResults) -> dict[str, str]:
    """SHA-256 of scorecard, option effects and all aggregated tables, by path below the study's folder."""
    tables = sorted(path for c in results.campaigns for path in (results.root / c.name / "tables").glob("*.parquet"))
    paths = [*(results.root / name for name in PUBLISHED_TABLES), *tables]
    return {p.relative_to(results.root).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in paths}


def read_study_lock(path: Path) -> dict[str, Any]:
    """The content of a lock; `BadInput` if it is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["lock_schema"] != LOCK_SCHEMA:
            raise BadInput(str(path), f"lock_schema must be {LOCK_SCHEMA} (got {content['lock_schema']!r})")
        return {"command": content["command"], "runs": content["runs"], "results_sha256": content["results_sha256"]}
    except OSError as problem:
        raise BadInput(str(path), f"cannot be read: {problem.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise BadInput(str(path), "is not the lock file of a study") from None


def differences(lock: dict[str, Any], results: StudyResults) -> list[str]:
    """What is not as a lock says, one line each; empty if the study is the same."""
    lines = []
    for name, run in lock["runs"].items():
        if not results.has(name):
            lines.append(f"{name}: was not run")
            continue
        ours = _run(results, name)
        lines += [
            f"{name}: {key} {ours[key]}, the lock has {run[key]}"
            for key in ("realisations", "campaign_sha256")
            if ours[key] != run[key]
        ]
        lines += [
            f"{name}: {library} {ours['versions'].get(library)}, the lock has {version}"
            for library, version in run["versions"].items()
            if ours["versions"].get(library) != version
        ]
    found = results_sha256(results)
    lines += [f"{path}: differs" for path, digest in lock["results_sha256"].items() if found.get(path) != digest]
    return list(dict.fromkeys(lines))


def _run(results: StudyResults, campaign: str) -> dict[str, Any]:
    lock = results.run(campaign).data.lock
    return {
        "realisations": results.n_fields(campaign),
        "campaign_sha256": lock["campaign_sha256"],
        "versions": lock["versions"],
    }


def _command(results: StudyResults) -> str:
    """The command that makes a study of this size."""
    words = ["survey-mc paper"]
    for scale in ("realisations", "images"):
        sizes = [results.n_fields(c.name) for c in results.campaigns if c.scale == scale and not c.is_option]
        if sizes:
            words.append(f"--{scale} {max(sizes)}")
    words.append("--options" if any(c.is_option for c in results.campaigns) else "--no-options")
    return " ".join(words)
