"""Files that nobody vouches for, opened without surprises.

Idea     a path may name a pipe that never answers, a device that never ends, or a file of any size: only regular files
         are opened, nothing waits, and no more than the caller's limit is read.
Limits   problems are `OSError`s whose `strerror` says what is wrong; the caller makes the sentence.
"""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path


def open_regular(path: Path | str) -> BufferedReader:
    """A regular file opened for reading; anything else, a folder or a pipe, is an `OSError` at once."""
    try:
        _refuse_irregular(os.stat(path).st_mode, path)  # some devices do something when they are opened
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except ValueError as problem:
        raise OSError(errno.EILSEQ, "its name has a null character", str(path)) from problem
    try:
        _refuse_irregular(os.fstat(handle).st_mode, path)  # it may have become another file meanwhile
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def _refuse_irregular(mode: int, path: Path | str) -> None:
    if not stat.S_ISREG(mode):
        kind = "is a directory, not a file" if stat.S_ISDIR(mode) else "is not a regular file"
        raise OSError(errno.EISDIR if stat.S_ISDIR(mode) else errno.EINVAL, kind, str(path))


def read_regular(path: Path | str, max_bytes: int) -> bytes:
    """Content of a regular file of at most `max_bytes` bytes; a larger one is an `OSError` before it is read."""
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = stream.read(max_bytes + 1) if size <= max_bytes else b""
    if max(size, len(content)) > max_bytes:
        size = max(size, len(content))
        raise OSError(errno.EFBIG, f"must be at most {max_bytes} bytes long (got {size})", str(path))
    return content
