"""One chunk of a log: its messages, their index, and both as bytes for the file.

The library builds these in a few dozen calls a message, which costs more than making the message.
Here a message is one ``pack`` and an index entry; the bytes are the library's own.
"""

import struct
import zlib
from typing import NamedTuple

import zstandard
from mcap.opcode import Opcode
from mcap.records import ChunkIndex

COMPRESSION = b"zstd"
_MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time; the data follow."""
_MESSAGE_FIELDS = _MESSAGE.size - 9
_OPCODE = int(Opcode.MESSAGE)
_INDEX = struct.Struct("<BQHI")
"""Opcode, length, channel, bytes of entries; pairs of log time and offset follow."""
_INDEX_FIELDS = _INDEX.size - 9
_CHUNK = struct.Struct(f"<BQQQQII{len(COMPRESSION)}sQ")
"""Opcode, length, first and last log time, size, checksum, compression, packed size; data."""
_CHUNK_FIELDS = _CHUNK.size - 9


class PackedChunk(NamedTuple):
    """A chunk ready for the file.

    Attributes
    ----------
    data : bytes
        The chunk record and its message indexes.
    entry : ChunkIndex
        Its entry in the file's summary.
    counts : dict of int to int
        Messages by channel.
    """

    data: bytes
    entry: ChunkIndex
    counts: dict[int, int]


class Chunk:
    """Collects records until they are packed; then starts over."""

    def __init__(self) -> None:
        self._compressor = zstandard.ZstdCompressor()
        self._records = bytearray()
        self._entries: dict[int, list[int]] = {}

    @property
    def has_messages(self) -> bool:
        """Whether there is a message to pack; a chunk without one is never written."""
        return bool(self._entries)

    def add_record(self, data: bytes) -> None:
        """Take a whole record, such as a schema or a channel."""
        self._records += data

    def add_message(self, channel: int, sequence: int, log_ns: int, data: bytes) -> None:
        """Take a message; it counts as published when it was logged."""
        records, length = self._records, _MESSAGE_FIELDS + len(data)
        head = _MESSAGE.pack(_OPCODE, length, channel, sequence, log_ns, log_ns)
        entries = self._entries.get(channel)
        if entries is None:
            self._entries[channel] = [log_ns, len(records)]
        else:
            entries += (log_ns, len(records))
        records += head
        records += data

    def pack(self, offset: int) -> PackedChunk:
        """Return the chunk for its place ``offset`` in the file, and forget it."""
        packed = self._compressor.compress(self._records)
        first_ns = min(min(entries[::2]) for entries in self._entries.values())
        last_ns = max(max(entries[::2]) for entries in self._entries.values())
        head = _CHUNK.pack(
            Opcode.CHUNK,
            _CHUNK_FIELDS + len(packed),
            first_ns,
            last_ns,
            len(self._records),
            zlib.crc32(self._records),
            len(COMPRESSION),
            COMPRESSION,
            len(packed),
        )
        parts = [head, packed]
        length = len(head) + len(packed)
        at = offset + length
        places: dict[int, int] = {}
        for channel, entries in self._entries.items():
            places[channel] = at
            index = struct.pack(f"<{len(entries)}Q", *entries)
            parts += (
                _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX_FIELDS + len(index), channel, len(index)),
                index,
            )
            at += _INDEX.size + len(index)
        entry = ChunkIndex(
            chunk_length=length,
            chunk_start_offset=offset,
            compression=COMPRESSION.decode(),
            compressed_size=len(packed),
            message_end_time=last_ns,
            message_index_length=at - offset - length,
            message_index_offsets=places,
            message_start_time=first_ns,
            uncompressed_size=len(self._records),
        )
        counts = {channel: len(entries) // 2 for channel, entries in self._entries.items()}
        self._records = bytearray()
        self._entries = {}
        return PackedChunk(b"".join(parts), entry, counts)
