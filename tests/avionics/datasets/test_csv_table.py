import numpy as np
import pytest
from numpy.testing import assert_array_equal

from avionics.datasets.csv_table import CsvColumns, Skips, read_csv
from avionics.errors import DataSetError

COLUMNS = CsvColumns(("t_ns",), ("gx",), ("ax", "t_arrival_ns"))


def read(tmp_path, text: str, skips: Skips | None = None):
    (tmp_path / "imu.csv").write_text(text, encoding="utf-8")
    return read_csv(tmp_path / "imu.csv", COLUMNS, skips or Skips())


def test_columns_are_found_by_name_and_missing_values_are_nan(tmp_path) -> None:
    table = read(tmp_path, "gx, t_ns,ax,note\n1.5,7,,a\n2.5,8,-9.8,b\n")
    assert_array_equal(table.integers, [[7], [8]])
    assert_array_equal(table.numbers, [[1.5, np.nan, np.nan], [2.5, -9.8, np.nan]])
    assert table.absent == ("t_arrival_ns",)


def test_times_beyond_2_to_the_53_stay_exact(tmp_path) -> None:
    late_ns = 1_700_000_000_000_000_001
    table = read(tmp_path, f"t_ns,gx,t_arrival_ns\n{late_ns},0,{late_ns + 2}\n")
    assert table.integers[0, 0] == late_ns
    assert table.optional_integers is not None
    assert table.optional_integers[0, 1] == late_ns + 2


def test_bad_rows_are_counted_with_their_first_lines(tmp_path) -> None:
    skips = Skips()
    good = "".join(f"{n},0\n" for n in range(9))
    table = read(tmp_path, "t_ns,gx\n" + good + "1\n2,inf\n99999999999999999999,0\nx,0\n", skips)
    assert len(table.integers) == 9
    assert skips.texts() == ["imu.csv: bad rows: 4 (line 11, 12, 13, ...)"]


def test_a_file_of_bad_rows_is_an_error(tmp_path) -> None:
    with pytest.raises(DataSetError, match=r"2 of 3 rows are bad, the first in line 3"):
        read(tmp_path, "t_ns,gx\n1,2\nx,2\ny,2\n")
