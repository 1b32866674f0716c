"""Columns that grow by a row at a time: packed bytes, which numpy sees as arrays without a copy.

An array taken from a column is read-only, and the column takes no more rows after that.
"""

from array import array
from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

TYPE_CODES = {np.int64: "q", np.float64: "d"}


def _frozen(packed: "array[Any] | bytearray", dtype: type[Any]) -> NDArray[Any]:
    """Return packed bytes as a read-only array."""
    values = np.frombuffer(packed, dtype=dtype)
    values.flags.writeable = False
    return values


class Numbers:
    """One number a row, eight bytes each.

    Parameters
    ----------
    dtype : type
        ``numpy.int64`` or ``numpy.float64``.
    """

    def __init__(self, dtype: type[np.int64] | type[np.float64]) -> None:
        self._dtype = dtype
        self._packed: array[Any] = array(TYPE_CODES[dtype])
        self.append: Callable[[Any], None] = self._packed.append

    def frozen(self) -> NDArray[Any]:
        """Return the column, shape (n,)."""
        return _frozen(self._packed, self._dtype)


class Rows:
    """Several components a row; the longest row gives the width.

    A shorter row ends in NaN (False in a column of flags), an absent one is NaN throughout.

    Parameters
    ----------
    *shape : int
        What the components are grouped into: (3,) makes rows of vectors. Empty: not grouped.
    dtype : type
        ``numpy.float64`` or ``numpy.bool_``.
    is_optional : bool
        Whether the column is None where every row was absent.
    """

    def __init__(
        self,
        *shape: int,
        dtype: type[np.float64] | type[np.bool_] = np.float64,
        is_optional: bool = False,
    ) -> None:
        self._shape, self._dtype, self._is_optional = shape, dtype, is_optional
        self._packed = bytearray()
        self._empty_row = b""
        self._width = 0
        self.count = 0

    def append(self, row: NDArray[Any] | None) -> None:
        """Add a row, flattened; None where the quantity is absent."""
        size = 0 if row is None else row.size
        if size > self._width:
            self._widen(size)
        packed = b"" if row is None else row.astype(self._dtype, copy=False).tobytes()
        self._packed += packed
        if size < self._width:
            self._packed += self._empty_row[len(packed) :]
        self.count += 1

    def _widen(self, size: int) -> None:
        """Lay out the earlier rows again, for rows of ``size`` components."""
        fill = False if self._dtype is np.bool_ else np.nan
        rows = np.full((self.count, size), fill, dtype=self._dtype)
        rows[:, : self._width] = self._rows()
        self._packed = bytearray(rows.tobytes())
        self._empty_row = np.full(size, fill, dtype=self._dtype).tobytes()
        self._width = size

    def _rows(self) -> NDArray[Any]:
        return _frozen(self._packed, self._dtype).reshape(self.count, self._width)

    def frozen(self) -> NDArray[Any] | None:
        """Return the column, shape (n, width) or (n, width / prod(shape), *shape), or None."""
        if self._is_optional and not self._width:
            return None
        if not self._shape:
            return self._rows()
        return self._rows().reshape(self.count, self._width // prod(self._shape), *self._shape)


class SparseRows:
    """A column that few records fill: the rows that did, and which they were."""

    def __init__(self) -> None:
        self._rows = Rows()
        self._numbers = Numbers(np.int64)
        self._count = 0

    def append(self, row: NDArray[np.float64] | None) -> None:
        """Add a row; None where the quantity is absent, which costs nothing."""
        if row is not None:
            self._rows.append(row)
            self._numbers.append(self._count)
        self._count += 1

    def frozen(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the numbers of the rows, shape (m,), and the rows, shape (m, width)."""
        values = self._rows.frozen()
        assert values is not None
        return self._numbers.frozen(), values


Column = Numbers | Rows | SparseRows
