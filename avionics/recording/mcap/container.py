"""An MCAP file from header to footer, made of the library's records around chunks of our own.

The same calls on the library's writer give the same bytes; this one takes a message several times
faster, see ``chunk``.
"""

import struct
import zlib
from collections.abc import Iterable, Mapping

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from avionics.recording.mcap.chunk import Chunk
from avionics.recording.mcap.logfile import LogFile

_FOOTER = struct.Struct("<BQQQ")
"""The part of the footer that its checksum covers: opcode, length, the two places."""
_FOOTER_BYTES = 20


def packed(records: Iterable[McapRecord]) -> bytes:
    """Return records as they stand in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


class Container:
    """Writes one MCAP file; chunks end where ``flush`` says.

    Parameters
    ----------
    file : LogFile
        Where the bytes go; the header goes at once.
    library : str
        Who wrote it, as the header says.
    """

    def __init__(self, file: LogFile, *, library: str) -> None:
        self._file = file
        self._chunk = Chunk()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self.add_message = self._chunk.add_message
        file.write(MCAP0_MAGIC + packed([Header(profile="", library=library)]))

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record."""
        record = packed([Metadata(name=name, metadata=dict(data))])
        self._metadata.append(
            MetadataIndex(offset=self._file.tell(), length=len(record), name=name)
        )
        self._file.write(record)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attached file, of no particular time."""
        attached = Attachment(
            create_time=0, log_time=0, name=name, media_type=media_type, data=data
        )
        record = packed([attached])
        self._attachments.append(
            AttachmentIndex(
                offset=self._file.tell(),
                length=len(record),
                create_time=0,
                log_time=0,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )
        self._file.write(record)

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Describe a kind of message; return its number."""
        schema = Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._chunk.add_record(packed([schema]))
        return schema.id

    def register_channel(self, topic: str, encoding: str, schema: int) -> int:
        """Begin a topic; return the number that its messages go by."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            metadata={},
            schema_id=schema,
        )
        self._channels.append(channel)
        self._chunk.add_record(packed([channel]))
        return channel.id

    def flush(self) -> None:
        """End the chunk, unless it holds no message."""
        if not self._chunk.has_messages:
            return
        data, entry, counts = self._chunk.pack(self._file.tell())
        self._file.write(data)
        self._chunks.append(entry)
        for channel, count in counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count

    def finish(self) -> None:
        """End the last chunk and write summary and footer."""
        self.flush()
        self._file.write(packed([DataEnd(data_section_crc=0)]))
        start = self._file.tell()
        groups: tuple[tuple[Opcode, Iterable[McapRecord]], ...] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary = bytearray()
        offsets = []
        for opcode, records in groups:
            group = packed(records)
            offsets.append(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offsets_start = start + len(summary)
        summary += packed(offsets)
        covered = _FOOTER.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offsets_start)
        footer = Footer(
            summary_start=start,
            summary_offset_start=offsets_start,
            summary_crc=zlib.crc32(covered, zlib.crc32(summary)),
        )
        self._file.write(bytes(summary) + packed([footer]) + MCAP0_MAGIC)

    def _statistics(self) -> Statistics:
        chunks = self._chunks
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((chunk.message_end_time for chunk in chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
