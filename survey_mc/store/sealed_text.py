"""A line of JSON that shows whether it is whole.

Idea     its last key is `crc`: the CRC-32 of the line as it is without that key. It is checked against the bytes, so
         every changed byte of the line is seen, and any JSON reader still reads the line. A CRC-32 sees every error of
         up to three bits in lines of this length, and any other but for 2⁻³².
"""

from __future__ import annotations

import re
from zlib import crc32

_SEAL = re.compile(rb', "crc": "([0-9a-f]{8})"\}')
_ALMOST = re.compile(rb', "[^"]{3}": "[^"]{8}"\}')  # with a letter of it changed
_SEAL_BYTES = 20


def seal(text: str) -> str:
    """The text of a JSON object, with at least one key and without line breaks, with its checksum as the last key."""
    return f'{text[:-1]}, "crc": "{crc32(text.encode()):08x}"}}'


def is_sealed(line: bytes) -> bool:
    """Whether a line (without its end) was written with a checksum, right or wrong, legible or not."""
    return _ALMOST.fullmatch(line[-_SEAL_BYTES:]) is not None


def opened(line: bytes) -> bytes | None:
    """The text of a sealed line without its checksum; None if it has none or a wrong one."""
    found = _SEAL.fullmatch(line[-_SEAL_BYTES:])
    if found is None:
        return None
    text = line[:-_SEAL_BYTES] + b"}"
    return text if crc32(text) == int(found[1], 16) else None
