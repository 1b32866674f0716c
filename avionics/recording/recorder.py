"""The recorder of a flight: the log writer behind a bounded queue, in threads of its own.

Slow or failing storage costs records, counted by cause, never the estimator's time.
"""

import logging
import threading
from collections import Counter, deque
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from avionics.config import FlightConfig
from avionics.errors import RecordingError, StorageError
from avionics.recording.writer import LogWriter
from avionics.records import EncodedFrame, Event, Health
from avionics.topics import Record, topic_of
from drivers.clock import Clock, SteadyClock
from drivers.samples import Frame

logger = logging.getLogger(__name__)

SOURCE = "recorder"
HEALTH_PERIOD_NS = 1_000_000_000
MAX_IMAGES = 64
"""Images that may wait, about 2 s of them; raw pictures would otherwise fill the memory."""
BATCH = 32
LINGER_S = 0.02
"""Records are collected for so long: a wake-up each costs the flight more than the writing."""


class _Entry(NamedTuple):
    record: Record
    arrival_ns: int

    @property
    def is_image(self) -> bool:
        return isinstance(self.record, Frame | EncodedFrame)


class Recorder:
    """A ``Sink`` that never blocks and never raises while it flies.

    Order is kept. When the queue is full, images give way first, then what comes last. Counters
    go into the log once a second as ``Health`` of "recorder": ``written``, ``queue_peak``,
    ``dropped_images`` and ``dropped_records`` (queue full), ``dropped_storage`` (the disk refused
    for too long), ``dropped_unwritable`` (a record that cannot be encoded), ``storage_errors``.

    Parameters
    ----------
    path : Path
        The log.
    config : Config or WingsConfig
        What flies; the recorder section sizes the queue and the chunks.
    utc_offset_ns : int
        UTC minus steady time, ns.
    clock : Clock, optional
        Times flushes; the steady clock by default.
    metadata, attachments, force
        As for ``LogWriter``.

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
        utc_offset_ns: int,
        clock: Clock | None = None,
        metadata: Mapping[str, str] | None = None,
        attachments: Mapping[str, bytes] | None = None,
        force: bool = False,
    ) -> None:
        self._writer = LogWriter(
            path,
            config,
            utc_offset_ns=utc_offset_ns,
            metadata=metadata,
            attachments=attachments,
            force=force,
        )
        self._clock: Clock = SteadyClock() if clock is None else clock
        self._settings = config.recorder
        self._chunk_ns = round(config.recorder.chunk_s * 1e9)
        self._queue: deque[_Entry] = deque()
        self._wake_at = max(1, min(BATCH, config.recorder.queue_records // 4))
        self._images = 0
        self._changed = threading.Condition()
        self._closing = False
        self._closed = False
        self._counters: Counter[str] = Counter()
        self._trouble: str | None = None
        self._begun_ns = 0
        self._health_ns: int | None = None
        self._arrival_ns = 0
        self._stopped = threading.Event()
        self._threads = [threading.Thread(target=self._run, name="recorder", daemon=True)]
        if config.recorder.fsync_s > 0:
            self._threads.append(
                threading.Thread(target=self._keep_synced, name="recorder-sync", daemon=True)
            )
        for thread in self._threads:
            thread.start()

    def write(self, record: Record, arrival_ns: int) -> None:
        """Queue one record; what does not fit is counted."""
        entry = _Entry(record, arrival_ns)
        with self._changed:
            if self._closing or self._stopped.is_set():
                self._counters["dropped_records"] += 1
            elif self._make_room(entry):
                self._queue.append(entry)
                self._images += entry.is_image
                self._counters["queue_peak"] = max(self._counters["queue_peak"], len(self._queue))
                if self._is_worth_waking():
                    self._changed.notify()

    def _is_worth_waking(self) -> bool:
        return len(self._queue) >= self._wake_at or self._images > 0 or self._closing

    def _make_room(self, entry: _Entry) -> bool:
        """Return whether the entry fits, at the cost of a waiting image if need be."""
        is_full = len(self._queue) >= self._settings.queue_records
        if entry.is_image:
            if is_full or self._images >= MAX_IMAGES:
                self._counters["dropped_images"] += 1
                return False
            return True
        if is_full and self._images:
            oldest = next(i for i, waiting in enumerate(self._queue) if waiting.is_image)
            del self._queue[oldest]
            self._images -= 1
            self._counters["dropped_images"] += 1
        elif is_full:
            self._counters["dropped_records"] += 1
            return False
        return True

    @property
    def counters(self) -> dict[str, int]:
        """What was written and what was dropped, by cause."""
        with self._changed:
            return dict(sorted(self._counters.items()))

    def _run(self) -> None:
        try:
            while batch := self._next_batch():
                for entry in batch:
                    self._write_one(entry)
                self._flush_if_due()
                self._report_health(batch[-1].arrival_ns)
            if self._health_ns is not None:
                self._write_health(self._arrival_ns)
        finally:
            self._stopped.set()

    def _next_batch(self) -> list[_Entry]:
        """Wait for records; an empty list means that the flight is over."""
        while True:
            with self._changed:
                self._changed.wait_for(self._is_worth_waking, self._longest_wait_s())
                taken = min(BATCH, len(self._queue))
                batch = [self._queue.popleft() for _ in range(taken)]
                self._images -= sum(entry.is_image for entry in batch)
                if batch or self._closing:
                    return batch
            self._flush_if_due()

    def _longest_wait_s(self) -> float:
        if not self._writer.has_open_chunk:
            return LINGER_S
        left_ns = self._begun_ns + self._chunk_ns - self._clock.now_ns()
        return min(max(0.0, left_ns * 1e-9), LINGER_S)

    def _write_one(self, entry: _Entry) -> None:
        if not self._writer.has_open_chunk:
            self._begun_ns = self._clock.now_ns()
        was_full = self._writer.is_full
        try:
            self._writer.write(*entry)
        except StorageError as error:
            is_lost = was_full and self._writer.is_full
            self._count("dropped_storage" if is_lost else "written")
            self._note_trouble(error)
        except RecordingError as error:
            self._count("dropped_unwritable")
            logger.warning("%s dropped: %s", topic_of(entry.record), error)
        else:
            self._count("written")

    def _flush_if_due(self) -> None:
        if not self._writer.has_open_chunk:
            return
        if self._clock.now_ns() - self._begun_ns >= self._chunk_ns:
            try:
                self._writer.flush()
            except StorageError as error:
                self._note_trouble(error)

    def _note_trouble(self, error: RecordingError) -> None:
        self._count("storage_errors")
        if self._trouble is None:
            logger.error("%s; going on, the rest waits in memory", error)
        self._trouble = str(error)

    def _report_health(self, arrival_ns: int) -> None:
        """Once a second, in the records' own time, and at once when storage works again."""
        if self._trouble is not None and not self._writer.is_pending:
            trouble, self._trouble = self._trouble, None
            logger.warning("storage works again")
            message = f"storage refused and works again: {trouble}"
            event = Event(arrival_ns, SOURCE, "error", message)
            self._write_one(_Entry(event, arrival_ns))
        self._arrival_ns = arrival_ns
        if self._health_ns is None or arrival_ns - self._health_ns >= HEALTH_PERIOD_NS:
            self._write_health(arrival_ns)

    def _write_health(self, arrival_ns: int) -> None:
        self._health_ns = arrival_ns
        health = Health(arrival_ns, SOURCE, self.counters)
        self._write_one(_Entry(health, arrival_ns))

    def _count(self, name: str) -> None:
        with self._changed:
            self._counters[name] += 1

    def _keep_synced(self) -> None:
        """Apart from the writing: a card may take seconds, and a kill must not find them here."""
        while not self._stopped.wait(self._settings.fsync_s):
            try:
                self._writer.sync()
            except StorageError as error:
                self._count("storage_errors")
                logger.error("%s", error)

    def close(self) -> None:
        """Write what waits and close the log; may be called twice.

        Raises
        ------
        RecordingError
            If records were lost to the disk or the recorder itself failed; the file holds
            everything else, whole.
        """
        if self._closed:
            return
        self._closed = True
        with self._changed:
            self._closing = True
            self._changed.notify()
        for thread in self._threads:
            thread.join()
        self._writer.close()
        lost = self._counters["dropped_storage"] + len(self._queue)
        if lost:
            msg = f"the log is incomplete: {lost} records could not be stored ({self._trouble})"
            raise RecordingError(msg)

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
