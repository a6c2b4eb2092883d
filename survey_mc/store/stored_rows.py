"""Rows of committed files: checked before they are parsed, and as today's tables have them.

Idea     page checksums do not cover a Parquet footer, so the SHA-256 of the whole file is compared first. Each file is
         read once. Its columns must be those that its table declares: a store from elsewhere is data and nothing else.
"""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from survey_mc.columns import Table
from survey_mc.errors import BadInput, DamagedStore
from survey_mc.store.layout import RunLayout
from survey_mc.store.manifest import Record
from survey_mc.store.parquet import ARROW_TYPES, arrow_schema, arrow_table, columns_of_schema, table_of_schema
from survey_mc.store.upgrades import PRESENT, is_present, present_table, upgraded

if TYPE_CHECKING:
    from pandas import DataFrame

REMEDY = "`survey-mc verify --repair` computes it again"
_ROWS_AT_ONCE = 65536


def read_piece(layout: RunLayout, record: Record, columns: Sequence[str] | None = None) -> DataFrame:
    """Rows of a committed file as today's tables have them, whatever version wrote it.

    Raises `DamagedStore` for a file that is not what the manifest says, `BadInput` for one of a later version.
    """
    where = str(layout.root / record.piece.path)
    if is_present(record.piece.family.table, record.schema_version, where):
        return _rows(_opened(layout, record), where, columns)
    _, rows = read_stored(layout, record)
    return rows if columns is None else rows[list(columns)]


def read_stored(layout: RunLayout, record: Record) -> tuple[Table, DataFrame]:
    """The declared table, as it is today, and the rows of a committed file."""
    data = stored_table(layout, record)
    return table_of_schema(data.schema), data.to_pandas(ignore_metadata=True)


def stored_table(layout: RunLayout, record: Record) -> pa.Table:
    """The same as an Arrow table with the schema that it would be stored with today."""
    name, where = record.piece.family.table, str(layout.root / record.piece.path)
    is_of_today = is_present(name, record.schema_version, where)
    file = _opened(layout, record)
    if is_of_today:
        # What Arrow has noted about the file in its schema is not of the table.
        return _arrow_rows(file, where).cast(arrow_schema(table_of_schema(file.schema_arrow)))
    rows = upgraded(name, record.schema_version, _rows(file, where), where)
    return _converted(present_table(name, columns_of_schema(file.schema_arrow), rows), rows, where)


def committed_bytes(layout: RunLayout, record: Record) -> bytes:
    """The whole of a committed file; one that is not what the manifest says raises `DamagedStore` with its name."""
    path = layout.root / record.piece.path
    try:
        status = path.stat()
        is_whole = stat.S_ISREG(status.st_mode) and status.st_size == record.size_bytes
        content = path.read_bytes() if is_whole else b""
    except OSError as problem:
        raise DamagedStore(f"{path}: is in the manifest and cannot be read ({problem.strerror}); {REMEDY}") from None
    if not is_whole or hashlib.sha256(content).hexdigest() != record.sha256:
        raise DamagedStore(f"{path}: has changed since it was written; {REMEDY}")
    return content


def parquet_file(content: bytes) -> pq.ParquetFile:
    """A Parquet file in memory, whose page checksums are verified as it is read."""
    return pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True)


def batches(file: pq.ParquetFile) -> Iterator[pa.RecordBatch]:
    """All its rows, a few at a time."""
    yield from file.iter_batches(batch_size=_ROWS_AT_ONCE, use_threads=False)


def schema_problem(record: Record, schema: pa.Schema) -> str:
    """What is wrong with the schema of a file, empty if nothing is: the table it holds, its version, its columns."""
    name, meta = record.piece.family.table, schema.metadata or {}
    held, version = (meta.get(key, b"?").decode(errors="replace")[:80] for key in (b"table", b"schema_version"))
    if held != name:
        return f"holds table {held!r}"
    if version != str(record.schema_version):
        return f"has schema version {version!r}"
    if record.schema_version != PRESENT[name].version:
        return ""
    declared = [(field.name, field.type) for field in arrow_schema(PRESENT[name])]
    found = [(field.name, field.type) for field in schema]
    is_declared = found[: len(declared)] == declared and all(kind in ARROW_TYPES.values() for _, kind in found)
    return "" if is_declared else f"does not have the columns of table {name!r}"


def _opened(layout: RunLayout, record: Record) -> pq.ParquetFile:
    content = committed_bytes(layout, record)
    where = layout.root / record.piece.path
    try:
        file = parquet_file(content)
    except (OSError, pa.ArrowException) as problem:
        raise DamagedStore(f"{where}: cannot be read ({str(problem)[:120]}); {REMEDY}") from None
    wrong = schema_problem(record, file.schema_arrow)
    if file.metadata.num_rows != record.rows:
        wrong = f"has {file.metadata.num_rows} rows, {record.rows} were written"
    if wrong:
        raise DamagedStore(f"{where}: {wrong}; {REMEDY}")
    return file


def _rows(file: pq.ParquetFile, where: str, columns: Sequence[str] | None = None) -> DataFrame:
    return _arrow_rows(file, where, columns).to_pandas(ignore_metadata=True)


def _arrow_rows(file: pq.ParquetFile, where: str, columns: Sequence[str] | None = None) -> pa.Table:
    try:
        return file.read(columns=list(columns) if columns else None, use_threads=False)
    except (OSError, pa.ArrowException) as problem:
        raise DamagedStore(f"{where}: cannot be read ({str(problem)[:120]}); {REMEDY}") from None


def _converted(table: Table, rows: DataFrame, where: str) -> pa.Table:
    """Rows with the declared types; `BadInput` where that would change a number."""
    for column in table.columns:
        if column.dtype != "string":
            values = rows[column.name].to_numpy()
            try:
                same = np.array_equal(values.astype(column.dtype), values.astype(np.float64), equal_nan=True)
            except (TypeError, ValueError):
                same = False
            if not same:
                raise BadInput(where, f"{table.name}.{column.name} has values that do not fit into {column.dtype}")
    return arrow_table(table, rows)
