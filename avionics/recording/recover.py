"""Make a cut or damaged log readable for every MCAP reader, without losing what is whole."""

from dataclasses import dataclass, field
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import Writer

from avionics.errors import RecordingError
from avionics.output_paths import refuse_inputs
from avionics.recording.mcap import parse
from avionics.recording.mcap.damage import Damage
from avionics.recording.mcap.logfile import LogFile
from avionics.recording.mcap.scan import RawRecord, message_of, open_log, records, summary


@dataclass(slots=True)
class Recovery:
    """What was brought over.

    Attributes
    ----------
    path : Path
        The new file.
    messages : int
        Messages in it.
    topics : int
        Topics that they are on.
    duration_s : float
        Log time from the first to the last, s.
    attachments : int
        Attached files in it.
    damage : Damage
        What the old file lacked.
    """

    path: Path
    messages: int = 0
    topics: int = 0
    duration_s: float = 0.0
    attachments: int = 0
    damage: Damage = field(default_factory=Damage)

    def text(self) -> str:
        """Return it as plain lines."""
        first = (
            f"{self.path}: {self.messages} messages on {self.topics} topics over"
            f" {self.duration_s:.2f} s, {self.attachments} attachments"
        )
        return f"{first}\n{self.damage.text()}"


def recover(broken: Path, fixed: Path, *, force: bool = False) -> Recovery:
    """Copy everything whole in ``broken`` into a finished log with an index.

    Messages keep their order, times, sequence numbers and bytes. Any MCAP file will do, not only
    ours.

    Parameters
    ----------
    broken : Path
        The log that was cut, killed or damaged; it is not changed.
    fixed : Path
        The log to write.
    force : bool
        Replace an existing ``fixed``.

    Raises
    ------
    OutputExistsError
        If ``fixed`` exists and ``force`` is False.
    RecordingError
        If ``broken`` is no MCAP file, or both are the same file.
    """
    refuse_inputs(fixed, broken)
    recovery = Recovery(fixed)
    with open_log(broken) as source:
        target = LogFile(fixed, force=force)
        try:
            copier = _Copier(target, recovery)
            index = [r for r in summary(source) if r.opcode in {Opcode.SCHEMA, Opcode.CHANNEL}]
            for record in records(source, recovery.damage):
                copier.take(record)
                while index:
                    copier.take(index.pop(0))
            if not copier.has_begun:
                msg = f"{broken}: holds nothing whole; nothing can be recovered"
                raise RecordingError(msg)
            copier.finish()
            target.commit()
            target.sync()
        except RecordingError:
            target.discard()
            raise
        finally:
            target.close()
    return recovery


class _Copier:
    """Writes raw records with the channel and schema numbers of a new file."""

    def __init__(self, target: LogFile, recovery: Recovery) -> None:
        self._target = target
        self._recovery = recovery
        self._writer = Writer(target)  # type: ignore[arg-type]  # needs write, tell, flush only
        self.has_begun = False
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._first_ns: int | None = None
        self._topics: set[int] = set()

    def take(self, record: RawRecord) -> None:
        opcode, body = record
        if not self.has_begun:
            self._begin(body if opcode == Opcode.HEADER else b"")
        if opcode == Opcode.MESSAGE:
            self._message(body)
        elif opcode == Opcode.SCHEMA and (schema := parse.schema(body)):
            self._schema(schema)
        elif opcode == Opcode.CHANNEL and (channel := parse.channel(body)):
            self._channel(channel)
        elif opcode == Opcode.ATTACHMENT:
            self._attachment(body)
        elif opcode == Opcode.METADATA and (described := parse.metadata(body)):
            self._writer.add_metadata(described.name, described.metadata)
        elif opcode == Opcode.STATISTICS and (written := parse.statistics(body)):
            missing = written.message_count - self._recovery.messages
            self._recovery.damage.missing_messages = max(0, missing)
        if self._target.is_pending:
            self._target.commit()

    def _begin(self, body: bytes) -> None:
        self.has_begun = True
        header = parse.header(body)
        profile, library = ("", "") if header is None else (header.profile, header.library)
        self._writer.start(profile=profile, library=library)

    def _schema(self, schema: Schema) -> None:
        """Register it once; the index at the end of a finished log repeats it."""
        if schema.id not in self._schemas:
            number = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._schemas[schema.id] = number

    def _channel(self, channel: Channel) -> None:
        if channel.id not in self._channels and channel.schema_id in self._schemas:
            self._channels[channel.id] = self._writer.register_channel(
                channel.topic,
                channel.message_encoding,
                self._schemas[channel.schema_id],
                channel.metadata,
            )

    def _message(self, body: bytes) -> None:
        message = message_of(body)
        channel = self._channels.get(message.channel)
        if channel is None:
            self._recovery.damage.undecodable += 1
            return
        self._writer.add_message(
            channel, message.log_ns, message.data, message.publish_ns, message.sequence
        )
        self._topics.add(channel)
        self._recovery.messages += 1
        self._first_ns = message.log_ns if self._first_ns is None else self._first_ns
        self._recovery.duration_s = (message.log_ns - self._first_ns) * 1e-9

    def _attachment(self, body: bytes) -> None:
        attached = parse.attachment(body)
        if attached is None:
            self._recovery.damage.damaged_attachments += 1
            return
        self._recovery.attachments += 1
        self._writer.add_attachment(
            attached.create_time,
            attached.log_time,
            attached.name,
            attached.media_type,
            attached.data,
        )

    def finish(self) -> None:
        """Write the index."""
        self._recovery.topics = len(self._topics)
        self._writer.finish()  # type: ignore[no-untyped-call]
