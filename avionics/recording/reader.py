"""The log reader: typed records in file order, from whole, cut and damaged logs alike."""

import json
from collections.abc import Callable, Collection, Iterator
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from google.protobuf.message import DecodeError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from avionics.config import FlightConfig
from avionics.config.load import parse_config
from avionics.errors import RecordingError
from avionics.recording.attached import CONFIG_JSON, METADATA_NAME
from avionics.recording.mcap import parse
from avionics.recording.mcap.damage import Damage
from avionics.recording.mcap.parse import channel_of
from avionics.recording.mcap.scan import (
    Place,
    RawMessage,
    is_closed,
    message_of,
    open_log,
    records,
    records_at,
    summary,
)
from avionics.recording.schema.decode import DECODER_OF
from avionics.records import EncodedFrame
from avionics.topics import Record

MESSAGE = int(Opcode.MESSAGE)


class LoggedRecord(NamedTuple):
    """One record as it stands in the log.

    Attributes
    ----------
    topic : str
        Its topic.
    record : ImuSample, Frame, MarkerTracks, WingShapeEstimate, Truth, Health or Event
        The record; an ``EncodedFrame`` in place of a ``Frame`` where images were not decoded.
    arrival_ns : int
        When it arrived, ns of the steady clock.
    """

    topic: str
    record: Record
    arrival_ns: int


class RawChannelMessage(NamedTuple):
    """One message, not decoded.

    Attributes
    ----------
    channel : Channel
        Its channel, which names the topic.
    schema : Schema or None
        Its schema.
    message : RawMessage
        Number, times and bytes.
    offset : int
        Where in the file ``LogReader.messages_at`` finds it again.
    """

    channel: Channel
    schema: Schema | None
    message: RawMessage
    offset: int


class LogReader:
    """Reads one log; every iteration starts at its beginning.

    Attributes
    ----------
    path : Path
        The file.
    metadata : dict of str to str
        The metadata record "avionics": versions, ``utc_offset_ns``, what the writer added.
    attachments : dict of str to bytes
        Attached files by name.
    utc_offset_ns : int
        UTC minus steady time, ns.
    truncated : bool
        The file was cut or never closed; what is whole in it is read all the same.
    damage : Damage
        What the last complete iteration had to leave out.

    Raises
    ------
    RecordingError
        If the file is missing, empty, no MCAP file, or not one of ours.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        self.damage = Damage()
        self._read_head()
        if not self.metadata:
            raise RecordingError(self._why_foreign())
        offset = self.metadata.get("utc_offset_ns", "")
        try:
            self.utc_offset_ns = int(offset)
        except ValueError as error:
            msg = f"{path}: metadata utc_offset_ns is {offset!r}, expected an integer"
            raise RecordingError(msg) from error

    def close(self) -> None:
        """Do nothing: the file is open only while an iteration runs."""

    def __enter__(self) -> "LogReader":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _read_head(self) -> None:
        with open_log(self.path) as file:
            self.truncated = not is_closed(file)
            for opcode, body in records(file, Damage()):
                if opcode == Opcode.METADATA:
                    described = parse.metadata(body)
                    if described is not None and described.name == METADATA_NAME:
                        self.metadata = dict(described.metadata)
                elif opcode == Opcode.ATTACHMENT:
                    attached = parse.attachment(body)
                    if attached is not None:
                        self.attachments[attached.name] = attached.data
                elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}:
                    return

    def _why_foreign(self) -> str:
        if self.truncated:
            return f"{self.path}: was cut before its description; nothing can be read from it"
        return (
            f"{self.path}: is an MCAP file, but not a log of this program (no metadata"
            f" '{METADATA_NAME}')"
        )

    @cached_property
    def config(self) -> FlightConfig:
        """The resolved configuration that flew.

        Raises
        ------
        RecordingError
            If the log holds none, or a damaged one.
        ConfigError
            If this version cannot read it.
        """
        origin = f"{self.path}: attachment {CONFIG_JSON}"
        try:
            tables = json.loads(self.attachments[CONFIG_JSON])
        except KeyError as error:
            msg = f"{origin} is missing or damaged"
            raise RecordingError(msg) from error
        except ValueError as error:
            msg = f"{origin} is not JSON: {error}"
            raise RecordingError(msg) from error
        return parse_config(tables, origin=origin, is_flown=True)

    def raw_messages(
        self, wanted: Callable[[Channel, Schema | None], bool] | None = None
    ) -> Iterator[RawChannelMessage]:
        """Yield every message undecoded, Foxglove's views included, in file order.

        Parameters
        ----------
        wanted : callable, optional
            Asked once per channel whether its messages are; None = all.
        """
        place = Place()
        for channel, schema, body in self._bodies(wanted, place):
            yield RawChannelMessage(channel, schema, message_of(body), place.offset)

    def messages_at(self, offset: int) -> Iterator[RawMessage]:
        """Yield the messages at an ``offset`` that ``raw_messages`` gave: those of one chunk."""
        with open_log(self.path) as file:
            for opcode, body in records_at(file, offset):
                if opcode == MESSAGE:
                    yield message_of(body)

    def _bodies(
        self, wanted: Callable[[Channel, Schema | None], bool] | None, place: Place | None = None
    ) -> Iterator[tuple[Channel, Schema | None, bytes]]:
        """Yield channel, schema and message record of every message that is wanted."""
        is_wanted: dict[int, bool] = {}
        damage = Damage()
        channels: dict[int, Channel] = {}
        schemas: dict[int, Schema] = {}
        count = expected = 0
        with open_log(self.path) as file:
            # The summary first: a damaged first chunk must not cost the names of all topics.
            for opcode, body in chain(summary(file), records(file, damage, place)):
                if opcode == MESSAGE:
                    number = channel_of(body)
                    channel = channels.get(number)
                    if channel is None:
                        damage.undecodable += 1
                        continue
                    count += 1
                    is_asked = is_wanted.get(number)
                    if is_asked is None:
                        schema = schemas.get(channel.schema_id)
                        is_asked = is_wanted[number] = wanted is None or wanted(channel, schema)
                    if is_asked:
                        yield channel, schemas.get(channel.schema_id), body
                elif opcode == Opcode.CHANNEL and (described := parse.channel(body)) is not None:
                    channels[described.id] = described
                elif opcode == Opcode.SCHEMA and (form := parse.schema(body)) is not None:
                    schemas[form.id] = form
                elif opcode == Opcode.STATISTICS and (written := parse.statistics(body)):
                    expected = written.message_count
        damage.missing_messages = max(0, expected - count)
        self.damage = damage

    def messages(
        self, topics: Collection[str] | None = None, *, decode_images: bool = True
    ) -> Iterator[LoggedRecord]:
        """Yield the records in file order.

        Parameters
        ----------
        topics : collection of str, optional
            Topics or patterns such as ``/imu/*``; None = all. Foxglove's views are no records.
        decode_images : bool
            False yields ``EncodedFrame`` instead of ``Frame``, to copy or to look at later.

        Yields
        ------
        LoggedRecord
            Topic, record and arrival.
        """

        def is_wanted(channel: Channel, schema: Schema | None) -> bool:
            if schema is None or schema.name not in DECODER_OF:
                return False
            return topics is None or any(fnmatchcase(channel.topic, p) for p in topics)

        undecodable = 0
        offset_ns = self.utc_offset_ns
        for channel, schema, body in self._bodies(is_wanted):
            assert schema is not None
            _, sequence, log_ns, _, data = message_of(body)
            try:
                record = DECODER_OF[schema.name](data, sequence, offset_ns)
                if decode_images and isinstance(record, EncodedFrame):
                    record = record.decode()
            except (DecodeError, ValueError, RecordingError):
                undecodable += 1
                continue
            yield LoggedRecord(channel.topic, record, log_ns - offset_ns)
        self.damage.undecodable += undecodable
