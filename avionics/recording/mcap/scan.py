"""Walk through the bytes of an MCAP file that may be cut or damaged.

The stock readers give up at the first flaw. This one takes every chunk whose checksum holds, steps
over the others, finds the next chunk behind a broken length, and reports what it left out.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from avionics.errors import RecordingError
from avionics.recording.mcap.damage import Damage

MAGIC = MCAP0_MAGIC
_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")
_MESSAGE = struct.Struct("<HIQQ")
_ZSTD_CHUNK = b"\x04\x00\x00\x00zstd"
"""Stands 37 bytes behind the opcode of each of our chunks: the place to find the thread again."""
_TO_CHUNK_START = _HEAD.size + _CHUNK.size
MAX_RECORD_BYTES = 1 << 31
_WINDOW = 1 << 22


class RawRecord(NamedTuple):
    """One record outside or inside a chunk."""

    opcode: int
    body: bytes


class RawMessage(NamedTuple):
    """One message, not decoded."""

    channel: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


@dataclass(slots=True)
class Place:
    """Where a scan is.

    Attributes
    ----------
    offset : int
        Where the record yielded last begins in the file; for one inside a chunk, the chunk.
    """

    offset: int = 0


def open_log(path: Path) -> BinaryIO:
    """Open a file and check that it begins like MCAP.

    Raises
    ------
    RecordingError
        Naming the file and what it is instead.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        msg = f"{path}: cannot be opened ({error.strerror}); give the path of a .mcap log"
        raise RecordingError(msg) from error
    try:
        begin = file.read(len(MAGIC))
    except OSError as error:
        file.close()
        msg = f"{path}: cannot be read ({error.strerror})"
        raise RecordingError(msg) from error
    if begin == MAGIC:
        return file
    file.close()
    if not begin:
        msg = f"{path}: is empty (0 bytes); nothing was recorded or the copy failed"
    elif MAGIC.startswith(begin):
        msg = f"{path}: was cut after {len(begin)} bytes; nothing is left in it"
    else:
        msg = f"{path}: is not an MCAP log (begins with {begin!r}, expected {MAGIC!r})"
    raise RecordingError(msg)


def records(file: BinaryIO, damage: Damage, place: Place | None = None) -> Iterator[RawRecord]:
    """Yield the records of the file; those of whole chunks are taken apart, indexes left out.

    A file that is still being written is read up to its size at the beginning.

    Parameters
    ----------
    file : binary file
        Positioned anywhere; read from behind the magic.
    damage : Damage
        Updated on the way; final when the iterator ends.
    place : Place, optional
        Updated on the way.
    """
    place = Place() if place is None else place
    size = file.seek(0, 2)
    position = len(MAGIC)
    damage.truncated = True
    while True:
        place.offset = position
        file.seek(position)
        head = file.read(min(_HEAD.size, max(0, size - position)))
        if len(head) < _HEAD.size:
            damage.skipped_bytes += len(head)
            return
        opcode, length = _HEAD.unpack(head)
        behind = position + _HEAD.size + length
        if behind > size or not _is_plausible(file, opcode, length):
            found = _next_chunk(file, position + 1, size)
            damage.skipped_bytes += (size if found is None else found) - position
            if found is None:
                if opcode == Opcode.CHUNK:
                    yield from _cut_chunk(file, position, size)
                return
            position = found
            continue
        if opcode == Opcode.FOOTER:
            damage.truncated = not is_closed(file)
            return
        file.seek(position + _HEAD.size)
        if opcode == Opcode.CHUNK:
            yield from _chunk_records(file.read(length), damage)
        elif opcode not in _INDEX:
            yield RawRecord(opcode, file.read(length))
        position = behind


def records_at(file: BinaryIO, offset: int) -> Iterator[RawRecord]:
    """Yield again what ``records`` found at a ``Place``: one record, or those of a chunk."""
    size = file.seek(0, 2)
    file.seek(offset)
    opcode, length = _HEAD.unpack(file.read(_HEAD.size))
    if opcode != Opcode.CHUNK:
        yield RawRecord(opcode, file.read(length))
    elif offset + _HEAD.size + length <= size:
        yield from _chunk_records(file.read(length), Damage())
    else:
        yield from _cut_chunk(file, offset, size)


_OPCODES = set(Opcode)
_INDEX = {Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX, Opcode.DATA_END}


def is_closed(file: BinaryIO) -> bool:
    """Return whether a file ends as a finished log does."""
    size = file.seek(0, 2)
    file.seek(max(0, size - len(MAGIC)))
    return file.read(len(MAGIC)) == MAGIC


def _is_plausible(file: BinaryIO, opcode: int, length: int) -> bool:
    """Return whether a length agrees with the one inside the record, read from behind the head."""
    if opcode not in _OPCODES or length > MAX_RECORD_BYTES:
        return False
    if opcode == Opcode.MESSAGE_INDEX:
        body = file.read(6)
        return len(body) == 6 and 6 + int.from_bytes(body[2:], "little") == length
    if opcode == Opcode.CHUNK:
        body = file.read(_CHUNK.size + 4)
        name_length = int.from_bytes(body[_CHUNK.size :], "little")
        if name_length > 16:
            return False
        packed = file.read(name_length + 8)[name_length:]
        begin = _CHUNK.size + 4 + name_length + 8
        return begin + int.from_bytes(packed, "little") == length
    return True


def summary(file: BinaryIO) -> Iterator[RawRecord]:
    """Yield the records of a finished log's summary: schemas and channels once more, statistics.

    Nothing if the file is not finished or its footer is damaged.
    """
    size = file.seek(0, 2)
    at = size - _FOOTER_TO_END
    if at < len(MAGIC) or not is_closed(file):
        return
    file.seek(at)
    opcode, _, start = struct.unpack("<BQQ", file.read(_HEAD.size + 8))
    if opcode != Opcode.FOOTER or not len(MAGIC) <= start < at:
        return
    file.seek(start)
    yield from inner_records(file.read(at - start))


_FOOTER_TO_END = _HEAD.size + 20 + len(MAGIC)


def _next_chunk(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the next chunk begins, at or behind ``start`` and before ``size``."""
    position = start + _TO_CHUNK_START
    overlap = len(_ZSTD_CHUNK) - 1
    while True:
        file.seek(position)
        window = file.read(min(_WINDOW, max(0, size - position)))
        at = window.find(_ZSTD_CHUNK)
        while at >= 0:
            candidate = position + at - _TO_CHUNK_START
            file.seek(candidate)
            if file.read(1) == bytes([Opcode.CHUNK]):
                return candidate
            at = window.find(_ZSTD_CHUNK, at + 1)
        if len(window) < _WINDOW:
            return None
        position += len(window) - overlap


def _chunk_records(body: bytes, damage: Damage) -> Iterator[RawRecord]:
    try:
        data = _unpacked(body)
    except (zstandard.ZstdError, ValueError, struct.error, MemoryError):
        damage.damaged_chunks += 1
        return iter(())
    return inner_records(data)


def _unpacked(body: bytes) -> bytes:
    """Return the records inside a chunk; ValueError if the checksum does not hold."""
    _, _, size, crc = _CHUNK.unpack_from(body)
    compression, packed = _compression(body)
    if compression == b"zstd":
        if zstandard.frame_content_size(packed) not in (size, -1):
            msg = "size"
            raise ValueError(msg)
        data = zstandard.decompress(packed, size)
    elif compression == b"":
        data = bytes(packed)
    else:
        msg = "compression"
        raise ValueError(msg)
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        msg = "checksum"
        raise ValueError(msg)
    return data


def _compression(body: bytes) -> tuple[bytes, bytes]:
    (name_length,) = struct.unpack_from("<I", body, _CHUNK.size)
    begin = _CHUNK.size + 4 + name_length + 8
    return body[_CHUNK.size + 4 : begin - 8], body[begin:]


def _cut_chunk(file: BinaryIO, position: int, size: int) -> Iterator[RawRecord]:
    """Yield the whole records of a chunk whose end is missing."""
    file.seek(position + _HEAD.size)
    body = file.read(size - position - _HEAD.size)
    try:
        compression, packed = _compression(body)
        data = (
            zstandard.ZstdDecompressor().decompressobj().decompress(packed)
            if compression == b"zstd"
            else packed
        )
    except (zstandard.ZstdError, struct.error, MemoryError):
        return
    yield from inner_records(data)


def inner_records(data: bytes) -> Iterator[RawRecord]:
    """Yield the whole records in the unpacked bytes of a chunk."""
    size, head, unpack = len(data), _HEAD.size, _HEAD.unpack_from
    begin = head
    while begin <= size:
        opcode, length = unpack(data, begin - head)
        end = begin + length
        if end > size:
            return
        yield RawRecord(opcode, data[begin:end])
        begin = end + head


def message_of(body: bytes) -> RawMessage:
    """Take a message record apart."""
    channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(body)
    return RawMessage(channel, sequence, log_ns, publish_ns, body[_MESSAGE.size :])
