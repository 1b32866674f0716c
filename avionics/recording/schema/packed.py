"""Arrays as protobuf bytes: a packed list of doubles or flags is the array's own memory.

Generated classes take such a list element by element, and estimates are little else.
"""

from operator import attrgetter
from typing import Any

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from numpy.typing import NDArray

LENGTH_DELIMITED = 2
DTYPES: dict[int, np.dtype[Any]] = {
    FieldDescriptor.TYPE_DOUBLE: np.dtype("<f8"),
    FieldDescriptor.TYPE_BOOL: np.dtype("?"),
}


def varint(number: int) -> bytes:
    """Return a non-negative number as protobuf writes it."""
    made = bytearray()
    while number > 0x7F:
        made.append(number & 0x7F | 0x80)
        number >>= 7
    made.append(number)
    return bytes(made)


class _Heads(dict[int, bytes]):
    """Tag and length before the elements of one field, by bytes of elements."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self._tag = varint(number << 3 | LENGTH_DELIMITED)

    def __missing__(self, size: int) -> bytes:
        self[size] = head = self._tag + varint(size)
        return head


class PackedFields:
    """Encodes some packed fields of one message from the attributes of the same names.

    Parameters
    ----------
    message : type of Message
        Generated class that declares the fields.
    names : str
        At least two fields of packed doubles or flags, in the order of their numbers.
    """

    def __init__(self, message: type[Message], *names: str) -> None:
        fields = [message.DESCRIPTOR.fields_by_name[name] for name in names]
        self._arrays = attrgetter(*names)
        self._kinds = [(_Heads(field.number), DTYPES[field.type]) for field in fields]

    def of(self, record: Any) -> bytes:
        """Return the fields of a record; an array that is empty or None leaves no byte."""
        parts: list[bytes] = []
        array: NDArray[Any] | None
        for array, (heads, dtype) in zip(self._arrays(record), self._kinds, strict=True):
            if array is None or not array.size:
                continue
            data = array.tobytes() if array.dtype is dtype else array.astype(dtype).tobytes()
            parts += (heads[len(data)], data)
        return b"".join(parts)
