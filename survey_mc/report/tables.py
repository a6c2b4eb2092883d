"""The aggregated tables of a run: as Parquet with units in the metadata, and as CSV with units in comments.

Idea     sums first, division last; every fraction and rate has an interval beside it.
Limits   CPU seconds depend on the machine and the moment: they go to `runs/`, not to `tables/`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from survey_mc.columns import Table
from survey_mc.report.aggregate import input_counts, method_tables
from survey_mc.report.source import RunSource
from survey_mc.report.table_columns import CPU_SECONDS, REPORT_TABLES, TABLES
from survey_mc.report.table_parts import Part, Parts, declared
from survey_mc.store.digest_list import forget_digests, write_digests
from survey_mc.store.files import write_whole

if TYPE_CHECKING:
    from pandas import DataFrame

WriteFrame = Callable[[Path, Table, "DataFrame"], None]


def build_tables(source: RunSource, out_dir: Path, write_frame: WriteFrame | None = None) -> dict[str, DataFrame]:
    """Aggregate a run and write `tables/<name>.{parquet,csv}`, `runs/cpu_seconds.*`, `tables.sha256` below `out_dir`.

    Returns the frames by name, `cpu_seconds` among them. write_frame: writer of Parquet, the store's if None.
    """
    if write_frame is None:
        from survey_mc.store import write_frame as store_writer

        write_frame = store_writer
    tables = aggregate(source)
    tables[CPU_SECONDS.name] = cpu_seconds(source)
    forget_digests(out_dir)
    for table in REPORT_TABLES:
        folder = out_dir / ("runs" if table is CPU_SECONDS else "tables")
        folder.mkdir(parents=True, exist_ok=True)
        write_frame(folder / f"{table.name}.parquet", table, tables[table.name])
        write_csv(folder / f"{table.name}.csv", table, tables[table.name])
    write_digests(out_dir, table_files(out_dir))
    return tables


def table_files(out_dir: Path) -> list[Path]:
    """The files that `build_tables` writes."""
    folders = [(table, out_dir / ("runs" if table is CPU_SECONDS else "tables")) for table in REPORT_TABLES]
    return [folder / f"{table.name}.{kind}" for table, folder in folders for kind in ("parquet", "csv")]


def aggregate(source: RunSource) -> dict[str, DataFrame]:
    """All tables of `TABLES`; a cell or method without results has no rows."""
    collected: Parts = {table.name: [] for table in TABLES}
    for cell in source.cells:
        inputs = input_counts(source, cell)
        for method in source.methods:
            for name, parts in method_tables(source, cell, method, inputs).items():
                collected[name].extend(parts)
    return {table.name: declared(table, collected[table.name]) for table in TABLES}


def cpu_seconds(source: RunSource) -> DataFrame:
    """Cost by cell, method and stage, summed over the journals of the run."""
    journal = source.journal()
    sums = journal.groupby(["cell", "method", "stage"], as_index=False, sort=True, dropna=False).agg(
        fields=("fields", "sum"), cpu_s=("cpu_s", "sum"), wall_s=("wall_s", "sum")
    )
    fields = sums["fields"].astype("float64")
    return declared(CPU_SECONDS, [Part(sums, {"cpu_s_per_field": sums["cpu_s"] / fields.where(fields > 0)})])


def write_csv(path: Path, table: Table, frame: DataFrame) -> None:
    """Write a table whose comment lines (#) give every column's unit and meaning; numbers keep all their digits."""
    lines = [f"# {table.about}"]
    for column in table.columns:
        unit = f" [{column.unit}]" if column.unit else ""
        lines.append(f"# {column.name}{unit}: {column.about}")
    rows = frame[list(table.names)].to_csv(index=False, na_rep="nan", lineterminator="\n")
    write_whole(path, ("\n".join(lines) + "\n" + rows).encode())
