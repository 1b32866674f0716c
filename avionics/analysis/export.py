"""A log as files that any program reads: CSV, or Parquet."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from avionics.analysis.flight import Flight
from avionics.analysis.tables import Column, Table
from avionics.desk import desk_imports
from avionics.errors import RecordingError
from avionics.output_paths import claim_folder

TableFormat = Literal["csv", "parquet"]


def export(
    flight: Flight,
    directory: Path,
    table_format: TableFormat = "csv",
    *,
    force: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[Path, int]:
    """Write one table per topic of a log.

    Parameters
    ----------
    flight : Flight
        The log; may be cut.
    directory : Path
        Where the tables go; created if it does not exist.
    table_format : str
        "csv": shortest digits that give the same number back, empty = not available; "parquet".
    force : bool
        Replace tables that are there already.
    progress : callable, optional
        Called with the number of tables written.

    Returns
    -------
    dict of Path to int
        Rows of every table written.

    Raises
    ------
    OutputExistsError
        If a table exists and ``force`` is False; nothing is written then.
    RecordingError
        If the log cannot be read or the directory cannot be written.
    AvionicsError
        If Parquet is asked for and pyarrow is not installed.
    """
    write = _write_csv if table_format == "csv" else _parquet_writer()
    tables = sorted(flight.tables.values(), key=lambda table: table.name)
    if not tables:
        msg = f"{flight.path}: holds no records; there is nothing to export"
        raise RecordingError(msg)
    paths = {table.name: directory / f"{table.name}.{table_format}" for table in tables}
    claim_folder(directory, force=force, files=[path.name for path in paths.values()])
    written = {}
    for number, table in enumerate(tables):
        path = paths[table.name]
        try:
            write(path, table)
        except OSError as error:
            msg = f"{path}: cannot be written ({error.strerror})"
            raise RecordingError(msg) from error
        written[path] = table.rows
        if progress is not None:
            progress(number + 1)
    return written


def _write_csv(path: Path, table: Table) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.columns)
        writer.writerows(zip(*(_texts(column) for column in table.columns.values()), strict=True))


def _texts(column: Column) -> list[Any]:
    """Return what the CSV shows; Python writes a float with the fewest digits that suffice."""
    if not isinstance(column, np.ndarray):
        return list(column)
    if column.dtype.kind == "f":
        return ["" if value != value else repr(value) for value in column.tolist()]  # noqa: PLR0124
    is_flag = column.dtype.kind == "b"
    return list((column.astype(np.int64) if is_flag else column).tolist())


def _parquet_writer() -> Callable[[Path, Table], None]:
    with desk_imports("Parquet", "use --format csv"):
        import pyarrow as pa  # noqa: PLC0415
        from pyarrow import parquet  # noqa: PLC0415

    def write(path: Path, table: Table) -> None:
        arrays = {
            name: pa.array(column, from_pandas=True) for name, column in table.columns.items()
        }
        parquet.write_table(pa.table(arrays), path)

    return write
