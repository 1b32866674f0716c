"""OptiTrack Motive CSV exports: labelled markers over time, drop-outs as NaN, ghosts left out."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from avionics.errors import DataSetError
from avionics.records import FloatArray

UNITS_M = {"Meters": 1.0, "Centimeters": 0.01, "Millimeters": 0.001}
GHOST = "Unlabeled"


@dataclass(frozen=True, slots=True, eq=False)
class MotiveTake:
    """One take.

    Attributes
    ----------
    name : str
        Name of the take.
    rate_hz : float
        Frame rate of the export.
    t_s : ndarray, shape (n,)
        Time since the start of the take, s.
    position_m : dict of str to ndarray, shape (n, 3)
        Labelled markers, Motive's axes (y up), m; NaN where missing.
    ghosts : int
        Unlabelled markers, left out.
    """

    name: str
    rate_hz: float
    t_s: FloatArray
    position_m: dict[str, FloatArray]
    ghosts: int


def read_motive(path: Path) -> MotiveTake:
    """Read a Motive CSV export, format 1.2x.

    Raises
    ------
    DataSetError
        If the file is missing, is no such export, holds no labelled marker or no frame.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="", errors="replace") as stream:
            return _take(path, csv.reader(line.replace("\0", "?") for line in stream))
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise DataSetError(msg) from error


def _take(path: Path, rows: Iterator[list[str]]) -> MotiveTake:
    first = next(rows, [])
    head = dict(zip(first[::2], first[1::2], strict=False))
    if head.get("Format Version", "")[:3] != "1.2":
        start = ",".join(first)[:40]
        msg = f"{path}: begins with '{start}', expected a Motive export 'Format Version,1.2x'"
        raise DataSetError(msg)
    scale = UNITS_M.get(head.get("Length Units", "Meters"))
    if scale is None:
        msg = (
            f"{path}: Length Units are {head['Length Units']}, expected one of {', '.join(UNITS_M)}"
        )
        raise DataSetError(msg)
    header: dict[str, list[str]] = {}
    for row in rows:
        if row and row[0] == "Frame":
            header["axis"] = row
            break
        if len(row) > 2 and not row[0]:
            header[row[1] or "kind"] = row
    if "axis" not in header or "Name" not in header:
        msg = f"{path}: has no header with the markers' names; is it whole?"
        raise DataSetError(msg)
    columns = _columns(header)
    labelled = {name: c for name, c in columns.items() if not name.startswith(GHOST)}
    if not labelled:
        msg = f"{path}: holds no labelled marker; label them in Motive and export again"
        raise DataSetError(msg)
    table = _numbers(path, rows, len(header["axis"]))
    return MotiveTake(
        head.get("Take Name", path.stem),
        float(head.get("Export Frame Rate", "0") or 0),
        table[:, 1],
        {name: scale * table[:, axes] for name, axes in labelled.items()},
        len(columns) - len(labelled),
    )


def _columns(header: dict[str, list[str]]) -> dict[str, list[int]]:
    """Return the X, Y, Z columns of every marker."""
    kinds = header.get("Type", [])
    found: dict[str, dict[str, int]] = {}
    for column, axis in enumerate(header["axis"]):
        is_marker = column < len(kinds) and kinds[column] == "Marker"
        if axis in ("X", "Y", "Z") and is_marker:
            found.setdefault(header["Name"][column], {})[axis] = column
    return {name: [axes[a] for a in "XYZ"] for name, axes in found.items() if len(axes) == 3}


def _numbers(path: Path, rows: Iterator[list[str]], width: int) -> NDArray[np.float64]:
    table = []
    for number, row in enumerate(rows, start=1):
        if not row:
            continue
        cells = row[:width] + [""] * (width - len(row))
        try:
            table.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError as error:
            msg = f"{path}: frame {number} below the header: {error}"
            raise DataSetError(msg) from error
    if not table:
        msg = f"{path}: has a header and no frames"
        raise DataSetError(msg)
    return np.array(table, dtype=np.float64)
