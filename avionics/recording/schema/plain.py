"""Records of numbers, texts and vectors to protobuf and back: their fields are the message's.

A record that holds nothing else needs no code of its own in ``encode`` and ``decode``.
"""

from collections.abc import Callable
from dataclasses import MISSING, fields
from operator import attrgetter
from typing import Any

import numpy as np
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto
from google.protobuf.message import Message

_DOUBLE = np.dtype(np.float64)


class PlainRecord:
    """Encodes and decodes one type of record whose fields have the names of its message's.

    Parameters
    ----------
    record : type
        Dataclass of int, float, str, bool, and float vectors of shape (n,); a vector whose default
        is None may be absent, which an empty list stands for.
    message : type
        Its protobuf message.

    Raises
    ------
    TypeError
        If the fields of the two differ.
    """

    def __init__(self, record: type, message: type[Message]) -> None:
        names = tuple(field.name for field in fields(record))
        described = DescriptorProto()
        message.DESCRIPTOR.CopyToProto(described)
        repeated = FieldDescriptorProto.LABEL_REPEATED
        is_vector = {field.name: field.label == repeated for field in described.field}
        if set(names) != set(is_vector):
            odd = ", ".join(sorted(set(names) ^ set(is_vector)))
            msg = f"{record.__name__} and message {message.DESCRIPTOR.full_name} differ in: {odd}"
            raise TypeError(msg)
        self._record: Callable[..., Any] = record
        self._message: Any = message
        self._names = names
        self._values = attrgetter(*names)
        self._vectors = [
            (i, field.default is not MISSING)
            for i, field in enumerate(fields(record))
            if is_vector[field.name]
        ]

    def encode(self, record: Any, _: int) -> bytes:
        """Return the protobuf bytes of a record."""
        values = list(self._values(record))
        for i, _may_be_absent in self._vectors:
            if values[i] is not None:
                values[i] = values[i].tolist()
        message = self._message(**dict(zip(self._names, values, strict=True)))
        packed: bytes = message.SerializeToString(deterministic=True)
        return packed

    def decode(self, data: bytes, _: int, __: int) -> Any:
        """Return the record of protobuf bytes."""
        values = list(self._values(self._message.FromString(data)))
        for i, may_be_absent in self._vectors:
            vector = values[i]
            is_absent = may_be_absent and not vector
            values[i] = None if is_absent else np.fromiter(vector, _DOUBLE, len(vector))
        return self._record(*values)
