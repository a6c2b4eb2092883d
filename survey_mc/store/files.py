"""Files as a run directory has them: regular ones, written whole, never followed to another place.

Idea     what is no regular file is never opened, so that no pipe can hold a reader up and no link leads it out. A file
         is written under a temporary name in its own folder and renamed when it is on the disk.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterator
from pathlib import Path

_TEMPORARY_NAME = re.compile(r"\..+\.(?:[0-9a-f]{32}|tmp)")
_NOUNS = {stat.S_IFLNK: "a link", stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


def what_it_is(path: Path) -> str:
    """ "a file", "a link", "a folder" …, or nothing if there is nothing; the path is not followed or opened."""
    try:
        kind = stat.S_IFMT(path.lstat().st_mode)
    except (OSError, ValueError):  # ValueError: a null character in the name
        return ""
    return "a file" if kind == stat.S_IFREG else _NOUNS.get(kind, "a device")


def is_plain(path: Path) -> bool:
    """Whether there is a regular file, and no link to one."""
    return what_it_is(path) == "a file"


def entries(folder: Path) -> Iterator[Path]:
    """Everything below a folder that is no folder itself, sorted by name in each; links are not followed."""
    waiting = [_sorted_entries(folder)]
    while waiting:
        entry = next(waiting[-1], None)
        if entry is None:
            waiting.pop()
        elif entry.is_dir(follow_symlinks=False):
            waiting.append(_sorted_entries(entry.path))
        else:
            yield Path(entry.path)


def _sorted_entries(folder: Path | str) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as found:
            return iter(sorted(found, key=lambda entry: entry.name))
    except (FileNotFoundError, NotADirectoryError):
        return iter(())


def file_sha256(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def fsync(path: Path) -> None:
    """Return when a file or a folder is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def temporary_path(path: Path) -> Path:
    """A new name beside a file, under which it is written."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}")


def is_temporary_name(name: str) -> bool:
    """Whether a file of that name is what a killed process was writing."""
    return _TEMPORARY_NAME.fullmatch(name) is not None


def write_whole(path: Path, content: bytes) -> None:
    """Write, fsync, rename: a reader sees the file as it was or as it is. A failed write leaves nothing."""
    temporary = temporary_path(path)
    try:
        with temporary.open("xb") as handle:
            handle.write(content)
            handle.flush()
            os.fsync(handle.fileno())
        temporary.replace(path)
        fsync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def set_aside(root: Path, path: str, folder: Path) -> None:
    """Move what is not ours, a path relative to root, to the same path below `folder`; what is there stays there."""
    target = folder / path
    number = 0
    while what_it_is(target):
        number += 1
        target = folder / f"{path}.{number}"
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(root / path, target)  # a folder of the run may be on another disk
