"""Content keys: the name of a result is a digest of all that it depends on, and of nothing else.

Idea     keys are chained: sky → field → detections → matches. Each stage adds only what it uses, so a new method
         computes only itself, a new radius only matches again, and a label, a comment or the order of keys recomputes
         nothing.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

KEY_DIGITS = 32

# Versions of the code behind each stage: raised when its answers change.
SKY_VERSION = 1
FIELD_VERSION = 1


def content_key(parent: str, **parts: Any) -> str:
    """Digest (32 hexadecimal digits) of a parent key and JSON-able parts; the order of parts does not matter."""
    text = json.dumps({"parent": parent, "parts": parts}, sort_keys=True, allow_nan=False, separators=(",", ":"))
    return hashlib.blake2b(text.encode(), digest_size=KEY_DIGITS // 2, person=b"survey_mc.key").hexdigest()


def realisation_key(key: str, realisation: int) -> str:
    """Key of one realisation of a stage; random streams hang on it."""
    return f"{key}/{realisation}"
