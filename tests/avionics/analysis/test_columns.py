import numpy as np
import pytest
from numpy.testing import assert_array_equal

from avionics.analysis.columns import Numbers, Rows, SparseRows

NAN = np.nan


def test_numbers_keep_every_bit() -> None:
    column = Numbers(np.int64)
    for value in (2**62 + 1, -1):
        column.append(value)
    assert column.frozen().tolist() == [2**62 + 1, -1]
    with pytest.raises(ValueError, match="read-only"):
        column.frozen()[0] = 0


def test_longest_row_gives_the_width() -> None:
    column = Rows()
    for row in ([1.0], [2.0, 3.0], None, [4.0, 5.0]):
        column.append(None if row is None else np.array(row))
    assert_array_equal(column.frozen(), [[1, NAN], [2, 3], [NAN, NAN], [4, 5]])


def test_rows_are_grouped() -> None:
    column = Rows(2)
    column.append(np.arange(6.0).reshape(3, 2))
    assert_array_equal(column.frozen(), [[[0, 1], [2, 3], [4, 5]]])


def test_a_flag_that_is_missing_is_false() -> None:
    column = Rows(dtype=np.bool_)
    column.append(np.array([True]))
    column.append(np.array([True, True]))
    assert_array_equal(column.frozen(), [[True, False], [True, True]])


@pytest.mark.parametrize(("is_optional", "expected"), [(True, None), (False, (2, 0, 3))])
def test_a_column_without_any_value(is_optional: bool, expected: object) -> None:
    column = Rows(3, is_optional=is_optional)
    column.append(None)
    column.append(None)
    found = column.frozen()
    assert (None if found is None else found.shape) == expected


def test_sparse_rows_know_where_they_belong() -> None:
    column = SparseRows()
    for row in (None, np.array([1.0, 2.0]), None, np.array([3.0, 4.0])):
        column.append(row)
    numbers, rows = column.frozen()
    assert_array_equal(numbers, [1, 3])
    assert_array_equal(rows, [[1, 2], [3, 4]])
