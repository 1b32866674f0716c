"""CSV files of a data set: columns by name, bad rows left out and reported by line."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.errors import DataSetError
from avionics.records import FloatArray

CsvRows = Any
"""A reader of the csv module: lists of text, and the number of the last line."""
EXAMPLES = 3
WORST_SHARE = 0.5


@dataclass(slots=True)
class Skips:
    """What was left out: counts by file and reason, with the first lines as examples."""

    counts: dict[tuple[str, str], int] = field(default_factory=dict)
    lines: dict[tuple[str, str], list[int]] = field(default_factory=dict)

    def add(self, file: str, reason: str, count: int | np.integer = 1, line: int = 0) -> None:
        """Count something that was left out."""
        key = (file, reason)
        self.counts[key] = self.counts.get(key, 0) + int(count)
        if line and len(self.lines.setdefault(key, [])) < EXAMPLES:
            self.lines[key].append(line)

    def texts(self) -> list[str]:
        """Return one line per reason."""
        texts = []
        for (file, reason), count in self.counts.items():
            lines = self.lines.get((file, reason))
            where = (
                f" (line {', '.join(str(n) for n in lines)}{', ...' if count > len(lines) else ''})"
                if lines
                else ""
            )
            texts.append(f"{file}: {reason}: {count}{where}")
        return texts


@dataclass(frozen=True, slots=True)
class CsvColumns:
    """Which columns a file has.

    Attributes
    ----------
    integers : tuple of str
        Must be there, 64-bit integers.
    needed : tuple of str
        Must be there and hold numbers.
    optional : tuple of str
        May be absent, and empty in any row.
    """

    integers: tuple[str, ...]
    needed: tuple[str, ...]
    optional: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CsvTable:
    """The good rows of a file.

    Attributes
    ----------
    integers : ndarray, shape (n, integers), int64
    numbers : ndarray, shape (n, needed + optional)
        NaN where an optional value is missing.
    optional_integers : ndarray, shape (n, optional), int64, or None
        Optional values as exact integers, where all that are given are.
    absent : tuple of str
        Optional columns that the file lacks.
    """

    integers: NDArray[np.int64]
    numbers: FloatArray
    optional_integers: NDArray[np.int64] | None
    absent: tuple[str, ...]


def read_csv(path: Path, columns: CsvColumns, skips: Skips) -> CsvTable:
    """Read a CSV file with a header.

    Parameters
    ----------
    path : Path
        The file; a byte-order mark and CRLF are fine.
    columns : CsvColumns
        What is wanted.
    skips : Skips
        Takes note of rows that were left out.

    Raises
    ------
    DataSetError
        If the file is missing, empty, lacks a needed column, or most of its rows are bad.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="", errors="replace") as stream:
            # A NUL byte, as after a power cut, would end the reader; it makes one bad row instead.
            rows = csv.reader(line.replace("\0", "?") for line in stream)
            return _read(path, rows, columns, skips)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror}); a data set needs it"
        raise DataSetError(msg) from error
    except csv.Error as error:
        msg = f"{path}: is no CSV file: {error}"
        raise DataSetError(msg) from error


def _read(path: Path, rows: CsvRows, columns: CsvColumns, skips: Skips) -> CsvTable:
    header = [name.strip() for name in next(rows, [])]
    if not header or header == [""]:
        msg = f"{path}: is empty; expected a header with {', '.join(columns.integers)}"
        raise DataSetError(msg)
    missing = [n for n in (*columns.integers, *columns.needed) if n not in header]
    if missing:
        what = ", ".join(missing)
        msg = f"{path}: column {what} is missing; the header is {','.join(header)[:120]}"
        raise DataSetError(msg)
    absent = tuple(n for n in columns.optional if n not in header)
    place = {name: header.index(name) for name in header}
    integers: list[list[int]] = []
    numbers: list[list[float]] = []
    exact: list[list[int]] = []
    is_exact, count, bad = True, 0, 0
    for row in rows:
        if not row:
            continue
        count += 1
        try:
            if len(row) != len(header):
                msg = f"{len(row)} fields instead of {len(header)}"
                raise ValueError(msg)
            first = [_integer(row[place[n]]) for n in columns.integers]
            wanted = [_number(row[place[n]]) for n in columns.needed]
            others = [_optional(row[place[n]]) if n in place else np.nan for n in columns.optional]
        except (ValueError, OverflowError):
            bad += 1
            skips.add(path.name, "bad rows", 1, rows.line_num)
            continue
        integers.append(first)
        numbers.append([*wanted, *others])
        if is_exact:
            try:
                exact.append(
                    [_integer(row[place[n]] or "0") if n in place else 0 for n in columns.optional]
                )
            except ValueError:
                is_exact = False
    if count and bad > WORST_SHARE * count:
        first_bad = skips.lines[path.name, "bad rows"][0]
        msg = f"{path}: {bad} of {count} rows are bad, the first in line {first_bad}; is it whole?"
        raise DataSetError(msg)
    if count == 0:
        msg = f"{path}: has a header and no rows; the recording is empty"
        raise DataSetError(msg)
    width = len(columns.needed) + len(columns.optional)
    return CsvTable(
        np.array(integers, dtype=np.int64).reshape(-1, len(columns.integers)),
        np.array(numbers, dtype=np.float64).reshape(-1, width),
        np.array(exact, dtype=np.int64).reshape(len(exact), -1)
        if is_exact and columns.optional
        else None,
        absent,
    )


def _integer(text: str) -> int:
    value = int(text)
    if not -(1 << 63) <= value < 1 << 63:
        msg = "beyond 64 bits"
        raise ValueError(msg)
    return value


def _number(text: str) -> float:
    value = float(text)
    if not np.isfinite(value):
        msg = "not finite"
        raise ValueError(msg)
    return value


def _optional(text: str) -> float:
    return float(text) if text.strip() else float("nan")
