"""Run directories as older versions wrote them: one store, and the files around it of each version.

The stored tables have been the same since the first version. `lock_schema_1` lacks the observed area of a cell's
region; `without_checksums` has no checksums in the lines of manifest and journal, and no digest in its lock; `present`
has them.
"""

from __future__ import annotations

import shutil
from pathlib import Path

FIXTURES = Path(__file__).parent / "fixtures"
VERSIONS = ("lock_schema_1", "without_checksums", "present")


def older_run(version: str, folder: Path) -> Path:
    """A copy of the run directory that a version left."""
    root = folder / version
    shutil.copytree(FIXTURES / "stored", root)
    shutil.copytree(FIXTURES / version, root, dirs_exist_ok=True)
    return root
