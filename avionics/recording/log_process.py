"""A log written by a process of its own, so that making rows and bytes takes another core.

For replays, which are as fast as the machine; a flight has its recorder thread. The process is
this module, started anew: nothing is forked, so the threads of the caller do not matter.
"""

import contextlib
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from avionics.config import FlightConfig
from avionics.config.load import parse_config
from avionics.errors import AvionicsError, RecordingError
from avionics.flight.estimate_rows import RowBatch, RowMaker
from avionics.flight.outputs import Item, RowWriter, Slot
from avionics.recording.schema.decode import DECODER_OF
from avionics.recording.schema.encode import encode, sequence_of
from avionics.recording.schema.messages import MESSAGE_OF, schema_name
from avionics.recording.writer import LogWriter
from drivers.samples import Frame

WAITING_BYTES = 64 << 20
"""So much may wait for the process to start, or for a slow disk."""


class _Coded(NamedTuple):
    """A record as bytes, which cross the pipe much faster than its arrays one by one."""

    schema: str
    data: bytes
    sequence: int
    arrival_ns: int


class LogProcess:
    """A ``BatchSink`` that writes one log; takes what ``LogWriter`` takes.

    Raises
    ------
    RecordingError
        From ``take`` or ``close``: whatever the process could not do.
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
        self._path = path
        self._utc_offset_ns = utc_offset_ns
        self._schemas: dict[type, str] = {}
        self._process = subprocess.Popen(
            [sys.executable, "-c", f"from {__name__} import serve; serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C is the parent's; this process ends when its pipe does.
            start_new_session=True,
        )
        self._waiting: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._waiting_bytes = 0
        self._room = threading.Condition()
        self._has_failed = threading.Event()
        self._sender = threading.Thread(target=self._send, name="log process", daemon=True)
        self._sender.start()
        options = {
            "utc_offset_ns": utc_offset_ns,
            "metadata": dict(metadata or {}),
            "attachments": dict(attachments or {}),
            "force": force,
        }
        self._put((path, config.model_dump(mode="json"), options))

    def take(self, batches: Sequence[RowBatch], items: Sequence[Item]) -> None:
        """Have records written in order, and the rows of each wing in their places."""
        self._put((batches, [self._coded(item) for item in items]))

    def _coded(self, item: Item) -> Item | _Coded:
        if isinstance(item, Slot) or isinstance(item[0], Frame):
            return item
        record, arrival_ns = item
        schema = self._schemas.get(type(record))
        if schema is None:
            schema = self._schemas[type(record)] = schema_name(MESSAGE_OF[type(record)])
        data = encode(record, self._utc_offset_ns)
        return _Coded(schema, data, sequence_of(record), arrival_ns)

    def _put(self, message: Any) -> None:
        if self._has_failed.is_set():
            self.close()
        data = pickle.dumps(message, protocol=5)
        with self._room:
            self._room.wait_for(lambda: self._waiting_bytes < WAITING_BYTES)
            self._waiting_bytes += len(data)
        self._waiting.put(data)

    def _send(self) -> None:
        """Feed the process; goes on taking when it has died, so that nobody waits for ever."""
        pipe = self._process.stdin
        assert pipe is not None
        while (data := self._waiting.get()) is not None:
            if not self._has_failed.is_set():
                try:
                    pipe.write(data)
                except OSError:
                    self._has_failed.set()
            with self._room:
                self._waiting_bytes -= len(data)
                self._room.notify()
        with contextlib.suppress(OSError):
            pipe.close()

    def close(self) -> None:
        """Wait until the log is complete; may be called twice."""
        if not self._sender.is_alive():
            return
        self._waiting.put(None)
        self._sender.join()
        assert self._process.stdout is not None
        with self._process.stdout as answer:
            failure = answer.read()
        status = self._process.wait()
        if failure:
            raise pickle.loads(failure)
        if status:
            how = f"was killed by signal {-status}" if status < 0 else f"ended with status {status}"
            msg = f"{self._path}: the process that writes it {how}"
            raise RecordingError(msg)

    def __enter__(self) -> "LogProcess":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def _write_log(source: BinaryIO) -> None:
    """Write the log that ``source`` describes, until it ends, however that comes about."""
    path, tables, options = pickle.load(source)
    config = parse_config(tables, origin=str(path), is_flown=True)
    offset_ns = options["utc_offset_ns"]
    with LogWriter(path, config, **options) as writer:
        rows = RowWriter([RowMaker(each) for each in config.wing_configs], writer)
        # A parent that was killed leaves half a message.
        with contextlib.suppress(EOFError, pickle.UnpicklingError):
            while True:
                batches, items = pickle.load(source)
                rows.take(batches, [_decoded(item, offset_ns) for item in items])


def _decoded(item: Item | _Coded, utc_offset_ns: int) -> Item:
    if not isinstance(item, _Coded):
        return item
    record: Any = DECODER_OF[item.schema](item.data, item.sequence, utc_offset_ns)
    return record, item.arrival_ns


def serve() -> None:
    """Be the process: a log described on stdin, what went wrong on stdout."""
    try:
        _write_log(sys.stdin.buffer)
    except AvionicsError as error:
        sys.stdout.buffer.write(pickle.dumps(error))
        sys.exit(1)
