"""The lock file of a run: is it as it was written, and by which version?

Idea     see `lock_form` for how every changed byte is seen. What older versions wrote is brought up to date when it is
         read.
Limits   lock files of the first versions have no SHA-256; of those only the form and the names of the entries are
         checked. The next run of their campaign gives them one.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from survey_mc.errors import BadInput
from survey_mc.lock_form import DIGEST, LOCK_SCHEMA, lock_digest, lock_text, loose_content
from survey_mc.store.files import is_plain, what_it_is

_OLD_ENTRIES = {"about", "campaign", "cells", "lock_schema", "methods", "name", "seed", "versions"}
_OLD_DIGESTS = {"campaign_sha256", "inputs_sha256"}  # the very first had none
REMEDY = "`survey-mc verify --repair`, or `survey-mc run` with the campaign file, writes it again"


def read_lock(path: Path) -> dict[str, Any]:
    """The content of a lock file as the present schema has it; `BadInput` if it is missing, damaged or newer."""
    if not what_it_is(path):
        folder = path.parent
        is_file = folder.exists() and not folder.is_dir()
        what = "is not a directory" if is_file else "is not a run directory (it has no campaign.lock.json)"
        raise BadInput(str(folder), what)
    problem = lock_problem(path)
    if problem:
        raise BadInput(str(path), f"is damaged: {problem}; {REMEDY}")
    content, _ = loose_content(path)
    try:
        for version in range(content["lock_schema"], LOCK_SCHEMA):
            content = _UPGRADES[version](content)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise BadInput(str(path), f"is damaged: it lacks what its schema has; {REMEDY}") from None
    return content


def lock_problem(path: Path) -> str:
    """What is wrong with a lock file, empty if nothing is; `BadInput` if a later version wrote it."""
    if not is_plain(path):
        return f"it is {what_it_is(path)}, not a file" if what_it_is(path) else "it is missing"
    content, raw = loose_content(path)
    schema = content.get("lock_schema")
    if type(schema) is not int or not isinstance(content.get("inputs_sha256", {}), dict):
        return "it cannot be read"
    newer = f"lock_schema {schema}, this survey_mc reads {LOCK_SCHEMA}"
    is_whole = lock_text(content).encode() == raw
    if DIGEST in content:
        is_whole = is_whole and content[DIGEST] == lock_digest(content)
    else:
        is_whole = is_whole and set(content) - _OLD_DIGESTS == _OLD_ENTRIES and schema <= LOCK_SCHEMA
    if not is_whole:
        why = f", unless a later version wrote it ({newer})" if schema > LOCK_SCHEMA else ""
        return f"it is not as it was written{why}"
    if schema > LOCK_SCHEMA:
        raise BadInput(str(path), f"was written by a later version ({newer}); install a newer survey_mc")
    return "" if schema in (LOCK_SCHEMA, *_UPGRADES) else f"there never was a lock_schema {schema}"


def _with_observed_areas(content: dict[str, Any]) -> dict[str, Any]:
    """Schema 1 had no observed area of a cell's region: it is what its instrument sees of the circle."""
    from survey_mc.telescope import InstrumentSettings
    from survey_mc.telescope.response import build_response
    from survey_mc.units import SECONDS_PER_KS

    settings = InstrumentSettings.model_validate_json(json.dumps(content["campaign"]["instrument"]))
    cells = []
    for cell in content["cells"]:
        response = build_response(settings, cell["band"], cell["exposure_ks"] * SECONDS_PER_KS)
        cells.append(cell | {"region_deg2": response.observed_deg2(cell["region_arcmin"])})
    return content | {"lock_schema": 2, "cells": cells}


_UPGRADES: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {1: _with_observed_areas}
