"""The log writer: records in pipeline order into an MCAP file, synchronous and byte-deterministic.

No clock and no thread here; ``recorder`` adds both for a flight.
"""

from collections.abc import Mapping
from pathlib import Path

from google.protobuf.message import Message

from avionics.config import FlightConfig
from avionics.errors import RecordingError
from avionics.recording.attached import (
    CONFIG_JSON,
    CONFIG_TOML,
    METADATA_NAME,
    config_toml,
    log_metadata,
    media_type,
    software_version,
)
from avionics.recording.foxglove.views import FoxgloveViews
from avionics.recording.images import encode_frame
from avionics.recording.mcap.container import Container
from avionics.recording.mcap.logfile import LogFile
from avionics.recording.schema.encode import encode, sequence_of
from avionics.recording.schema.messages import MESSAGE_OF, schema_bytes, schema_name
from avionics.topics import Record, topic_of
from drivers.samples import Frame


class LogWriter:
    """A ``Sink`` that writes one log.

    Configuration, version, clock offset and further attachments stand at the start of the file, so
    that a killed flight explains itself. What was written more than ``recorder.chunk_s`` of
    arrival time ago has left the process.

    Parameters
    ----------
    path : Path
        The file; its directory must exist.
    config : Config or WingsConfig
        What flies; attached, and the recorder section decides chunks and images.
    utc_offset_ns : int
        UTC minus steady time, ns; one constant per log.
    metadata : mapping of str to str, optional
        Further keys of the metadata record "avionics", e.g. ``{"command": "sim", "seed": "0"}``.
    attachments : mapping of str to bytes, optional
        Further attachments by file name, e.g. the calibration and its residuals.
    force : bool
        Replace an existing file.

    Raises
    ------
    OutputExistsError
        If the file exists and ``force`` is False.
    RecordingError
        If it cannot be created or written.
    """

    def __init__(
        self,
        path: Path,
        config: FlightConfig,
        *,
        utc_offset_ns: int = 0,
        metadata: Mapping[str, str] | None = None,
        attachments: Mapping[str, bytes] | None = None,
        force: bool = False,
    ) -> None:
        self._recorder = config.recorder
        self._utc_offset_ns = utc_offset_ns
        self._file = LogFile(path, force=force)
        self._path = path
        self._is_open = True
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._views = FoxgloveViews(config, utc_offset_ns=utc_offset_ns)
        self._chunk_start_ns: int | None = None
        self._chunk_bytes = 0
        self._chunk_ns = round(config.recorder.chunk_s * 1e9)
        self._mcap = Container(self._file, library=f"wing-avionics {software_version()}")
        described = log_metadata(config, utc_offset_ns=utc_offset_ns, extra=metadata)
        self._mcap.add_metadata(METADATA_NAME, described)
        files = {
            CONFIG_JSON: config.model_dump_json(indent=1).encode(),
            CONFIG_TOML: config_toml(config).encode(),
            **(attachments or {}),
        }
        for name, data in files.items():
            self._mcap.add_attachment(name, media_type(name), data)
        self._file.commit()

    def write(self, record: Record, arrival_ns: int) -> None:
        """Take one record that arrived at ``arrival_ns``.

        Raises
        ------
        RecordingError
            If the log is closed, the record cannot be encoded, or it arrived before 1970.
        StorageError
            If the disk refuses. The record waits in memory for the next flush, unless the log
            ``is_full`` already.
        """
        if isinstance(record, Frame):
            if not self._recorder.images:
                return
            record = encode_frame(
                record,
                self._recorder.image_format,
                jpeg_quality=self._recorder.jpeg_quality,
            )
        topic = topic_of(record)
        log_ns = arrival_ns + self._utc_offset_ns
        self._check(topic, log_ns)
        if self._chunk_start_ns is None:
            self._chunk_start_ns = log_ns
        data = encode(record, self._utc_offset_ns)
        self._add(topic, MESSAGE_OF[type(record)], data, log_ns, sequence_of(record))
        for view_topic, message in self._views.of(record, arrival_ns):
            packed = message.SerializeToString(deterministic=True)
            self._add(view_topic, type(message), packed, log_ns, 0)
        age_ns = log_ns - self._chunk_start_ns
        if self._chunk_bytes >= self._recorder.chunk_bytes or not 0 <= age_ns < self._chunk_ns:
            self.flush()

    def _check(self, topic: str, log_ns: int) -> None:
        if not self._is_open:
            msg = f"{self._path}: {topic} came after the log was closed"
            raise RecordingError(msg)
        if not 0 <= log_ns < 1 << 64:
            msg = f"{self._path}: {topic} arrived at {log_ns} ns UTC; MCAP wants 1970 or later"
            raise RecordingError(msg)
        if self._file.is_full:
            self.flush()

    def _add(
        self, topic: str, message: type[Message], data: bytes, log_ns: int, sequence: int
    ) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._register(topic, message)
        self._mcap.add_message(channel, sequence, log_ns, data)
        self._chunk_bytes += len(data)

    def _register(self, topic: str, message: type[Message]) -> int:
        name = schema_name(message)
        schema = self._schemas.get(name)
        if schema is None:
            schema = self._mcap.register_schema(name, "protobuf", schema_bytes(message))
            self._schemas[name] = schema
        self._channels[topic] = self._mcap.register_channel(topic, "protobuf", schema)
        return self._channels[topic]

    def flush(self) -> None:
        """End the chunk and hand it to the operating system.

        Raises
        ------
        StorageError
            If the disk refuses; what waits is tried again with the next flush.
        """
        self._chunk_start_ns = None
        self._chunk_bytes = 0
        self._mcap.flush()
        self._file.commit()

    def sync(self) -> None:
        """Have the device store what was flushed, safe from a power cut.

        May be called from another thread than the rest: slow storage then delays no flush.

        Raises
        ------
        StorageError
            If the device fails.
        """
        self._file.sync()

    @property
    def is_full(self) -> bool:
        """Whether records are refused because the disk has refused for too long."""
        return self._file.is_full

    @property
    def is_pending(self) -> bool:
        """Whether flushed bytes wait for a disk that refused them."""
        return self._file.is_pending

    @property
    def has_open_chunk(self) -> bool:
        """Whether records wait for a flush."""
        return self._chunk_start_ns is not None

    def close(self) -> None:
        """Write the index and close the file; may be called twice.

        Raises
        ------
        StorageError
            If the disk refuses; the file then ends with its last whole record.
        """
        if not self._is_open:
            return
        self._is_open = False
        try:
            self._mcap.finish()
            self._file.commit()
            self._file.sync()
        finally:
            self._file.close()

    def __enter__(self) -> "LogWriter":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
