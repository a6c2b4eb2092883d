"""A FITS file taken apart as bytes that nobody vouches for.

Idea     walk the header-data units by what their headers declare and compare with what is there, before anything is
         allocated; hand out only the one unit that was asked for. Packed files are unpacked as a stream.
Source   FITS standard 4.0 (IAU FITS Working Group 2018): sect. 3 (structure), 4.4.1 (mandatory cards), app. J (sums).
Limits   tile-compressed images are refused with advice; the checksum of a unit is compared only when the unit is read.
"""

from __future__ import annotations

import errno
import gzip
import os
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Literal

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.files import open_regular
from survey_mc.fits.header import card, integer, text

if TYPE_CHECKING:
    from astropy.io.fits import Header

BLOCK_BYTES = 2880  # FITS standard 3.1
CARD_BYTES = 80
MAX_PIXELS = 2**26  # 8192², larger than any survey tile; 512 MiB as float64
MAX_TABLE_BYTES = 2**30
MAX_UNPACKED_BYTES = 2**29  # a packed megabyte can claim a gigabyte
MAX_HEADER_BLOCKS = 1000  # 36 000 cards; mosaics of hundreds of exposures have a few thousand
MAX_HEADERS_BYTES = 3 * MAX_HEADER_BLOCKS * BLOCK_BYTES  # of all units together: a second to parse
MAX_HDUS = 2000
MAX_DECLARED_BYTES = 2**62  # what no file system holds
MAX_LISTED = 12  # units, or axes, in an error sentence
MAX_NAME = 68  # characters that fit a card
GZIP_MAGIC = b"\x1f\x8b"
_PRINTABLE = bytes(byte if 32 <= byte < 127 else ord("?") for byte in range(256))

Kind = Literal["image", "table", "compressed image", "other"]


@dataclass(frozen=True, slots=True)
class Hdu:
    """One header-data unit. axes: NAXIS1, NAXIS2, …; data: its bytes without padding, empty when not asked for."""

    index: int
    name: str
    kind: Kind
    header: Header
    head: bytes
    axes: tuple[int, ...]
    data: bytes = b""

    @property
    def shape(self) -> str:
        """The lengths of the axes as a sentence shows them."""
        more = " × …" if len(self.axes) > MAX_LISTED else ""
        return " × ".join(str(length) for length in self.axes[:MAX_LISTED]) + more


@contextmanager
def quiet() -> Iterator[None]:
    """Silence what libraries say about files: what matters becomes an error of ours, the rest is not for the user."""
    from astropy import log

    level = log.level
    log.setLevel("ERROR")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)


def read_hdu(path: str | Path, hdu: int | str | None, kind: Literal["image", "table"]) -> tuple[Hdu, Hdu]:
    """The unit that was asked for, with its data, and the primary unit (for what its header says about all).

    hdu: number from 0, EXTNAME, or None for the first unit of that kind that has data. Raises `BadInput`.
    """
    where = str(path)
    asked = int(hdu) if isinstance(hdu, str) and hdu.isdecimal() else hdu

    def is_wanted(unit: Hdu) -> bool:
        if asked is None:
            return unit.kind == kind and len(unit.axes) > 0
        return unit.index == asked if isinstance(asked, int) else unit.name.casefold() == asked.casefold()

    others: list[tuple[str, Kind]] = []  # what is said of each unit; their headers would fill the memory
    primary: Hdu | None = None
    found: Hdu | None = None
    with quiet(), _opened(path) as (stream, n_bytes):
        for unit in _walk(stream, n_bytes, where, is_wanted):
            primary = primary or unit
            found = found or (unit if is_wanted(unit) else None)
            shown = unit.kind if unit.axes else "empty"
            others.append((f"{unit.index}: {unit.name[:MAX_NAME] or 'unnamed'} ({shown})", unit.kind))
        if primary is None or found is None or found.kind != kind:
            raise BadInput(where, _why_not(others, found, hdu, kind))
        _check_sums(found, f"{where}[{found.index}]")
    return found, primary


def _why_not(units: list[tuple[str, Kind]], found: Hdu | None, hdu: int | str | None, kind: str) -> str:
    listing = ", ".join(shown for shown, _ in units[:MAX_LISTED])
    if any(k == "compressed image" for _, k in units) and kind == "image" and (found or hdu is None):
        return f"the image is tile-compressed; unpack it first (funpack); the file has {listing}"
    if found is not None:
        return f"HDU {hdu!r} is {_an(found.kind)}, expected {_an(kind)}; the file has {listing}"
    if hdu is not None:
        return f"there is no HDU {hdu!r}; the file has {listing}"
    advice = "; bin the event list into an image first" if kind == "image" and len(units) > 1 else ""
    return f"there is no {kind} in it; the file has {listing}{advice}"


def _an(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


@contextmanager
def _opened(path: str | Path) -> Iterator[tuple[IO[bytes], int | None]]:
    """The unpacked byte stream and its length (None for a packed file); every failure of the system is a sentence."""
    where = str(path)
    try:
        with open_regular(path) as raw:
            n_bytes = os.fstat(raw.fileno()).st_size
            if n_bytes == 0:
                raise BadInput(where, "is empty (0 bytes), expected a FITS file")
            packed = raw.read(2) == GZIP_MAGIC
            raw.seek(0)
            if packed:
                with gzip.open(raw, "rb") as unpacked:
                    yield unpacked, None  # type: ignore[misc]
            else:
                yield raw, n_bytes
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BadInput(where, f"the packed file is truncated or damaged ({error})") from error
    except FileNotFoundError:
        raise BadInput(where, "there is no such file; give the path of a FITS file") from None
    except OSError as error:
        if error.errno in (errno.EISDIR, errno.EINVAL):
            raise BadInput(where, f"{error.strerror}; give the path of a FITS file") from None
        raise BadInput(where, f"cannot be read ({error.strerror or error})") from error


def _walk(stream: IO[bytes], n_bytes: int | None, where: str, is_wanted: Callable[[Hdu], bool]) -> Iterator[Hdu]:
    """Every unit in order, the first that `is_wanted` with its data. The whole declared length is checked."""
    position, n_header_bytes, is_read = 0, 0, False
    for index in range(MAX_HDUS):
        place = f"{where}[{index}]"
        head = _read_header(stream, index, place)
        if head is None:
            return
        position, n_header_bytes = position + len(head), n_header_bytes + len(head)
        if n_header_bytes > MAX_HEADERS_BYTES:
            raise BadInput(place, f"its headers have more than {MAX_HEADERS_BYTES} bytes; cut out the image you need")
        unit = _parse(head, index, place)
        size = _declared_bytes(unit, place)
        wanted = not is_read and is_wanted(unit)
        is_read |= wanted
        if wanted:
            _refuse_too_large(unit, size, place)
        if n_bytes is not None and position + size > n_bytes:
            raise BadInput(
                place,
                f"truncated: {position + size - n_bytes} of the {size} data bytes its header declares are missing",
            )
        if n_bytes is None and position + size > MAX_UNPACKED_BYTES:
            raise BadInput(
                place,
                f"declares {size} bytes in a packed file; at most {MAX_UNPACKED_BYTES} are unpacked: unpack it first",
            )
        padded = -(-size // BLOCK_BYTES) * BLOCK_BYTES
        data = stream.read(padded) if wanted else b""
        n_got = len(data) if wanted else _skip(stream, padded, n_bytes)
        if n_got < size:
            raise BadInput(place, f"truncated: {size - n_got} of the {size} data bytes its header declares are missing")
        position += padded
        yield Hdu(index, unit.name, unit.kind, unit.header, unit.head, unit.axes, data) if wanted else unit
    raise BadInput(where, f"has more than {MAX_HDUS} header-data units")


def _skip(stream: IO[bytes], n_skip: int, n_bytes: int | None) -> int:
    """Bytes passed over, fewer than `n_skip` at the end of the file."""
    if n_bytes is not None:
        start = stream.tell()
        return stream.seek(min(start + n_skip, n_bytes)) - start
    n_left = n_skip
    while n_left > 0 and (piece := stream.read(min(n_left, 2**20))):
        n_left -= len(piece)
    return n_skip - n_left


def _read_header(stream: IO[bytes], index: int, place: str) -> bytes | None:
    """Header blocks up to END; None at the end of the file."""
    blocks: list[bytes] = []
    while len(blocks) < MAX_HEADER_BLOCKS:
        block = stream.read(BLOCK_BYTES)
        if not blocks:
            if index > 0 and not block.strip(b"\0 "):
                return None
            expected = b"SIMPLE  =" if index == 0 else b"XTENSION="
            if not block.startswith(expected):
                problem = "is not a FITS file (it does not begin with SIMPLE)" if index == 0 else (
                    "what follows the last HDU is neither an extension nor padding: the file is damaged"
                )  # fmt: skip
                raise BadInput(place if index else place.removesuffix("[0]"), problem)
        if len(block) < BLOCK_BYTES:
            raise BadInput(place, "truncated inside its header")
        blocks.append(block)
        if any(block[i : i + CARD_BYTES].rstrip() == b"END" for i in range(0, BLOCK_BYTES, CARD_BYTES)):
            return b"".join(blocks)
    raise BadInput(place, f"its header has no END card in the first {MAX_HEADER_BLOCKS} blocks")


def _parse(head: bytes, index: int, place: str) -> Hdu:
    from astropy.io.fits import Header

    # Only printable ASCII is allowed (standard 4.1.2); a stray byte must not stop the reading of the other cards,
    # and must not vanish from a number either: "?" makes that number unreadable.
    try:
        header = Header.fromstring(head.translate(_PRINTABLE))
    except Exception as error:  # the parser is given unknown bytes: whatever it says, the header is unreadable
        raise BadInput(place, f"its header cannot be read ({error})") from error
    n_axes = integer(header, "NAXIS", place)
    if n_axes is None or not 0 <= n_axes <= 999:
        raise BadInput(place, f"NAXIS must be 0..999 (got {n_axes})")
    axes = []
    for number in range(1, n_axes + 1):
        length = integer(header, f"NAXIS{number}", place)
        if length is None or length < 0:
            raise BadInput(place, f"NAXIS{number} must be a length of 0 or more (got {length})")
        axes.append(length)
    name = text(header, "EXTNAME", place) or ("PRIMARY" if index == 0 else "")
    return Hdu(index, name, _kind(header, index, place), header, head, tuple(axes))


def _kind(header: Header, index: int, place: str) -> Kind:
    if card(header, "ZIMAGE", place) is True:
        return "compressed image"
    extension = "IMAGE" if index == 0 else text(header, "XTENSION", place)
    kinds: dict[str | None, Kind] = {"IMAGE": "image", "IUEIMAGE": "image", "BINTABLE": "table"}
    return "other" if card(header, "GROUPS", place) is True else kinds.get(extension, "other")


def _declared_bytes(unit: Hdu, place: str) -> int:
    """Length of the data as the header declares it (standard, eq. 1 and 2), without padding."""
    bits = integer(unit.header, "BITPIX", place)
    if bits not in (8, 16, 32, 64, -32, -64):
        raise BadInput(place, f"BITPIX must be 8, 16, 32, 64, -32 or -64 (got {bits})")
    n_parameters = integer(unit.header, "PCOUNT", place) or 0
    n_groups = integer(unit.header, "GCOUNT", place)
    n_groups = 1 if n_groups is None else n_groups
    if n_parameters < 0 or n_groups < 0:
        raise BadInput(place, f"PCOUNT and GCOUNT must not be negative (got {n_parameters} and {n_groups})")
    axes = unit.axes[1:] if card(unit.header, "GROUPS", place) is True and unit.axes[:1] == (0,) else unit.axes
    n_values = 1 if axes else 0
    for length in axes:
        n_values *= length
    size = abs(bits) // 8 * n_groups * (n_parameters + n_values)
    if size > MAX_DECLARED_BYTES:
        raise BadInput(place, f"declares {unit.shape} values; at most {MAX_DECLARED_BYTES} bytes fit any file")
    return size


def _refuse_too_large(unit: Hdu, size: int, place: str) -> None:
    bits = abs(int(unit.header["BITPIX"]))
    if unit.kind == "image" and size * 8 > MAX_PIXELS * bits:
        raise BadInput(place, f"the image has {unit.shape} pixels; at most {MAX_PIXELS} are read")
    if size > MAX_TABLE_BYTES:
        raise BadInput(place, f"declares {size} bytes; at most {MAX_TABLE_BYTES} are read")


def ones_complement_sum(data: bytes) -> int:
    """The 32-bit ones'-complement sum of big-endian words (standard, app. J)."""
    whole = data + b"\0" * (-len(data) % 4)
    total = int(np.frombuffer(whole, dtype=">u4").sum(dtype=np.uint64))
    while total >> 32:
        total = (total & 0xFFFFFFFF) + (total >> 32)
    return total


def _check_sums(unit: Hdu, place: str) -> None:
    """Compare CHECKSUM and DATASUM where the header has them (an empty value means: not computed)."""
    declared = text(unit.header, "DATASUM", place)
    data_sum = ones_complement_sum(unit.data)
    if declared and (not declared.isdecimal() or int(declared) != data_sum):
        raise BadInput(
            place, f"DATASUM is {declared} but the data sum to {data_sum}: the file is damaged or was edited"
        )
    if text(unit.header, "CHECKSUM", place):
        total = ones_complement_sum(unit.head + unit.data)
        if total not in (0, 0xFFFFFFFF):
            raise BadInput(place, "CHECKSUM does not agree with the HDU: the file is damaged or was edited")
