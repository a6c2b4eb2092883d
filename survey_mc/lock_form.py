"""The form of a run's lock file, for those who write it and those who check it.

Idea     it carries the SHA-256 of its own content and may be written in one way only, so that every changed byte is
         seen.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from survey_mc.files import read_regular

LOCK_SCHEMA = 2  # 2: cells have the observed area of their region
DIGEST = "digest"
_MAX_BYTES = 16_000_000  # the largest campaign that is allowed has a few million


def lock_digest(content: Mapping[str, Any]) -> str:
    """SHA-256 of a lock's content without its digest."""
    bare = {name: value for name, value in content.items() if name != DIGEST}
    return hashlib.sha256(json.dumps(bare, sort_keys=True).encode()).hexdigest()


def with_digest(content: Mapping[str, Any]) -> dict[str, Any]:
    """The content with the schema it is in and its digest."""
    whole = {**content, "lock_schema": LOCK_SCHEMA}
    return whole | {DIGEST: lock_digest(whole)}


def lock_text(content: Mapping[str, Any]) -> str:
    """The one way in which a lock file is written."""
    return json.dumps(content, indent=1, sort_keys=True) + "\n"


def loose_content(path: Path) -> tuple[dict[str, Any], bytes]:
    """What a lock file says, whole or not, empty if it is no JSON object; and its bytes."""
    raw = b""
    try:
        raw = read_regular(path, _MAX_BYTES)
        content = json.loads(raw.decode("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}, raw
    return content if isinstance(content, dict) else {}, raw
