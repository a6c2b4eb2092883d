"""Parquet files whose schema is given, whose bytes are deterministic and which are whole or absent.

Idea     write to a temporary name on the same file system, read back with page checksums, fsync, rename. Unit, UCD and
         meaning of every column travel in the Arrow field metadata.
Limits   equal bytes are promised for the same versions of pyarrow; a reader elsewhere sees equal values.
"""

from __future__ import annotations

import hashlib
import os
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from survey_mc.columns import Column, Table
from survey_mc.errors import DamagedStore
from survey_mc.store.layout import Piece, RunLayout
from survey_mc.store.manifest import Record

if TYPE_CHECKING:
    from pandas import DataFrame

_ARROW_TYPES = {
    "int32": pa.int32(),
    "int64": pa.int64(),
    "float64": pa.float64(),
    "bool": pa.bool_(),
    "string": pa.string(),
}
_ZSTD_LEVEL = 1


def arrow_schema(table: Table) -> pa.Schema:
    """Arrow schema of a declared table, with unit, ucd and about in the field metadata."""
    fields = [
        pa.field(c.name, _ARROW_TYPES[c.dtype], metadata={"unit": c.unit, "ucd": c.ucd, "about": c.about})
        for c in table.columns
    ]
    return pa.schema(fields, metadata={"table": table.name, "about": table.about, "schema_version": str(table.version)})


def columns_of_schema(schema: pa.Schema) -> tuple[Column, ...]:
    """The declared columns a stored schema carries (the inverse of `arrow_schema`)."""
    names = {arrow: name for name, arrow in _ARROW_TYPES.items()}
    return tuple(
        Column(f.name, names[f.type], *((f.metadata or {}).get(k, b"").decode() for k in (b"about", b"unit", b"ucd")))  # type: ignore[arg-type]
        for f in schema
    )


def _arrow_table(table: Table, frame: DataFrame) -> pa.Table:
    schema = arrow_schema(table)
    missing = [name for name in table.names if name not in frame.columns]
    if missing:
        raise ValueError(f"table {table.name!r} lacks the columns {missing}")
    arrays = []
    for column, field in zip(table.columns, schema, strict=True):
        values = frame[column.name]
        if column.dtype == "string":
            arrays.append(pa.array(values, type=field.type))
        else:
            numbers = np.ascontiguousarray(values.to_numpy(), dtype=np.dtype(column.dtype))
            arrays.append(pa.array(numbers, type=field.type, from_pandas=False))
    return pa.Table.from_arrays(arrays, schema=schema)


def _write(path: Path | pa.NativeFile, data: pa.Table) -> None:
    # Split into byte streams, measured numbers pack 10 % smaller at the lowest level than otherwise at level 3, and
    # twice as fast.
    pq.write_table(
        data,
        path,
        compression="zstd",
        compression_level=_ZSTD_LEVEL,
        write_page_checksum=True,
        use_dictionary=[f.name for f in data.schema if f.type == pa.string()],
        use_byte_stream_split=[f.name for f in data.schema if f.type == pa.float64()],
        row_group_size=max(data.num_rows, 1),
    )


def _fsync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def file_sha256(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def _write_whole(temporary: Path, final: Path, data: pa.Table) -> str:
    """Write, read back, fsync, rename, fsync the folder; the SHA-256 of the file. A failed write leaves nothing."""
    temporary.parent.mkdir(parents=True, exist_ok=True)
    final.parent.mkdir(parents=True, exist_ok=True)
    try:
        _write(temporary, data)
        back = pq.read_table(temporary, page_checksum_verification=True, use_threads=False)
        if back.num_rows != data.num_rows:
            raise OSError(f"{final.name}: wrote {data.num_rows} rows and read back {back.num_rows}")
        digest = file_sha256(temporary)
        _fsync(temporary)
        temporary.replace(final)
        _fsync(final.parent)
    finally:
        temporary.unlink(missing_ok=True)
    return digest


def commit_piece(layout: RunLayout, piece: Piece, table: Table, frame: DataFrame) -> Record:
    """Store a piece; done twice it writes the same bytes to the same name. Its record has to enter the manifest."""
    final = layout.root / piece.path
    digest = _write_whole(layout.temporary / f"{uuid.uuid4().hex}.parquet", final, _arrow_table(table, frame))
    return Record(piece, digest, len(frame), final.stat().st_size, table.version)


def read_piece(layout: RunLayout, record: Record, columns: Sequence[str] | None = None) -> DataFrame:
    """Rows of a committed file; one that is not what the manifest says raises `DamagedStore` with its name.

    Page checksums do not cover a Parquet footer, so the SHA-256 of the whole file is compared before it is parsed.
    """
    path = layout.root / record.piece.path
    remedy = "`survey-mc verify --repair` computes it again"
    try:
        content = path.read_bytes()
    except OSError as problem:
        raise DamagedStore(f"{path}: is in the manifest and cannot be read ({problem.strerror}); {remedy}") from None
    if hashlib.sha256(content).hexdigest() != record.sha256:
        raise DamagedStore(f"{path}: has changed since it was written; {remedy}")
    data = pq.read_table(pa.BufferReader(content), columns=list(columns) if columns else None, use_threads=False)
    return data.to_pandas()


def piece_table(layout: RunLayout, piece: Piece) -> Table:
    """The declared table a stored file carries in its own schema."""
    schema = pq.read_schema(layout.root / piece.path)
    meta = schema.metadata or {}
    return Table(
        meta[b"table"].decode(), meta[b"about"].decode(), columns_of_schema(schema), int(meta[b"schema_version"])
    )


def empty_frame(table: Table) -> DataFrame:
    """No rows, with the columns and types that stored rows of a table are read with."""
    return arrow_schema(table).empty_table().to_pandas(ignore_metadata=True)


def read_frame(path: Path) -> DataFrame:
    """An aggregated table, page checksums verified."""
    return pq.read_table(path, page_checksum_verification=True, use_threads=False, partitioning=None).to_pandas()


def encoded_bytes(table: Table, frame: DataFrame) -> int:
    """Size of a frame as a stored file, without writing it."""
    sink = pa.BufferOutputStream()
    _write(sink, _arrow_table(table, frame))
    return int(sink.getvalue().size)


def write_frame(path: Path, table: Table, frame: DataFrame) -> None:
    """Write an aggregated table as Parquet with the same promises as the store."""
    _write_whole(path.with_name(f".{path.name}.{uuid.uuid4().hex}"), path, _arrow_table(table, frame))
