"""MCAP records from bytes: what stands outside the messages."""

import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from typing import TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Header, Metadata, Schema, Statistics

T = TypeVar("T")
BROKEN = (McapError, struct.error, UnicodeDecodeError, ValueError)
"""What the library raises on bytes that are no such record."""


def _read(body: bytes, read: Callable[[ReadDataStream], T]) -> T | None:
    try:
        return read(ReadDataStream(BytesIO(body)))
    except BROKEN:
        return None


def header(body: bytes) -> Header | None:
    """Return the header, or None if the bytes are damaged."""
    return _read(body, Header.read)


def channel(body: bytes) -> Channel | None:
    """Return the channel, or None if the bytes are damaged."""
    return _read(body, Channel.read)


def schema(body: bytes) -> Schema | None:
    """Return the schema, or None if the bytes are damaged."""
    return _read(body, Schema.read)


def metadata(body: bytes) -> Metadata | None:
    """Return the metadata record, or None if the bytes are damaged."""
    return _read(body, Metadata.read)


def statistics(body: bytes) -> Statistics | None:
    """Return the statistics, or None if the bytes are damaged."""
    return _read(body, Statistics.read)


def attachment(body: bytes) -> Attachment | None:
    """Return the attachment, or None if its checksum does not hold."""
    crc = int.from_bytes(body[-4:], "little")
    if crc and zlib.crc32(body[:-4]) != crc:
        return None
    return _read(body, Attachment.read)


def channel_of(body: bytes) -> int:
    """Return the channel of a message record."""
    return body[0] | body[1] << 8
