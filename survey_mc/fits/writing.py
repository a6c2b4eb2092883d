"""How files of this room come to be: whole, checked and reproducible.

Idea     the bytes are made in memory, written under a temporary name in the same folder and renamed; no time stamp
         anywhere (neither DATE nor in the checksum comments), so equal results are equal files.
Source   FITS standard 4.0; FITS header text is ASCII, so Greek and typographic signs are spelt out.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import tempfile
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from survey_mc import __version__
from survey_mc.columns import Column
from survey_mc.errors import BadInput

if TYPE_CHECKING:
    from astropy.io.fits import BinTableHDU, HDUList
    from pandas import DataFrame

CHECKSUM_COMMENT = "HDU checksum (no time stamp: reproducible)"
_SPELT = str.maketrans(
    {"σ": "sigma", "β": "beta", "×": "x", "−": "-", "–": "-", "″": " arcsec", "′": " arcmin", "²": "2"}
)
_FORMATS = {"int32": "J", "int64": "K", "float64": "D", "bool": "L"}
_DTYPES = {"int32": np.int32, "int64": np.int64, "float64": np.float64, "bool": np.bool_}


def creator() -> str:
    """Name and version for CREATOR cards."""
    return f"survey_mc {__version__}"


def ascii_text(words: str) -> str:
    """The words in printable ASCII, as FITS headers need them."""
    spelt = unicodedata.normalize("NFKD", words.translate(_SPELT))
    return "".join(c if 32 <= ord(c) < 127 else "?" for c in spelt if not unicodedata.combining(c))


def check_target(path: str | Path, overwrite: bool) -> Path:
    """The path as a place where a file can be written; `BadInput` before any work is done for nothing."""
    target = Path(path)
    try:
        if not target.parent.is_dir():
            raise BadInput(str(path), f"its folder {str(target.parent)!r} does not exist")
        if target.is_dir():
            raise BadInput(str(path), "is a directory, expected the name of a file")
        if target.exists() and not target.is_file():
            raise BadInput(str(path), "is a device or a pipe, expected the name of a file")
        if target.exists() and not overwrite:
            raise BadInput(str(path), "exists already; allow overwriting or choose another name")
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise BadInput(str(path), f"cannot be written ({getattr(error, 'strerror', None) or error})") from error
    return target


def write_whole(path: str | Path, content: bytes, overwrite: bool) -> None:
    """Write under a temporary name, sync and rename, so that no reader ever sees half of a file. ".gz" is packed."""
    target = check_target(path, overwrite)
    whole = gzip.compress(content, mtime=0) if target.suffix == ".gz" else content
    temporary = ""
    try:
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=".survey_mc-")
        with os.fdopen(handle, "wb") as stream:
            stream.write(whole)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
        problem = f"cannot be written ({error.strerror or error}; {len(whole)} bytes are needed)"
        raise BadInput(str(path), problem) from error


def _umask() -> int:
    """The mask of this process; it can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def fits_bytes(units: HDUList) -> bytes:
    """The file as bytes, with CHECKSUM and DATASUM in every unit."""
    for unit in units:
        unit.add_checksum(when=CHECKSUM_COMMENT)
    stream = io.BytesIO()
    units.writeto(stream, output_verify="exception")
    return stream.getvalue()


def table_unit(name: str, columns: Iterable[Column], frame: DataFrame) -> BinTableHDU:
    """A binary table with unit (TUNIT), UCD (TUCD) and meaning (TCOMM) of every column."""
    from astropy.io import fits

    declared = tuple(columns)
    unit = fits.BinTableHDU.from_columns([_fits_column(c, frame[c.name].to_numpy()) for c in declared], name=name)
    for number, column in enumerate(declared, start=1):
        if column.ucd:
            unit.header[f"TUCD{number}"] = column.ucd
        unit.header[f"TCOMM{number}"] = ascii_text(column.about)
    return unit


def _fits_column(column: Column, values: np.ndarray) -> Any:
    from astropy.io import fits

    if column.dtype == "string":
        words = [ascii_text(str(value)) for value in values]
        width = max([1, *(len(word) for word in words)])
        return fits.Column(name=column.name, format=f"{width}A", array=np.array(words, dtype=f"S{width}"))
    array: np.ndarray = values.astype(_DTYPES[column.dtype])
    return fits.Column(name=column.name, format=_FORMATS[column.dtype], unit=column.unit or None, array=array)


def parameter_cards(parameters: dict[str, Any]) -> list[tuple[str, Any, str]]:
    """Header cards of named parameters: SMCPARAM with all of them as JSON, HIERARCH SMC … for each short one."""
    cards: list[tuple[str, Any, str]] = [("SMCPARAM", ascii_json(parameters), "")]
    for name, value in parameters.items():
        shown = value if isinstance(value, bool | int | float) else ascii_json(value).strip('"')
        key = f"HIERARCH SMC {name.upper()}"
        if len(key) + len(str(shown)) <= 70:  # one card of 80 characters: quotes, "= " and spaces are the rest
            cards.append((key, shown, ""))
    return cards


def ascii_json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=True)
