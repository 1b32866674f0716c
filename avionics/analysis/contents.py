"""One pass over a log: every record goes into columns, or is only counted, and none is kept."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, TypeAlias

from google.protobuf.message import DecodeError
from mcap.records import Channel, Schema

from avionics.analysis.collectors import KEPT, HealthCollector, SeriesCollector
from avionics.analysis.frames import IMAGE_SCHEMA, FrameCollector, Frames
from avionics.analysis.series import HealthSeries, Series
from avionics.recording import Damage
from avionics.recording.reader import LogReader, RawChannelMessage
from avionics.recording.schema.decode import DECODER_OF
from avionics.records import Event, Health, WingShapeEstimate
from drivers.samples import ImuSample

TopicArrays: TypeAlias = Series | Frames | HealthSeries | tuple[Event, ...]
STARTING = (ImuSample, WingShapeEstimate)
"""Records whose first one is the start of the flight."""


@dataclass(slots=True)
class TopicCount:
    """How many records a topic has, and when they came.

    Attributes
    ----------
    count : int
        Records on it.
    first_ns, last_ns : int
        Arrival of the first and the last, ns of the steady clock.
    """

    count: int
    first_ns: int
    last_ns: int

    @property
    def rate_hz(self) -> float:
        """Mean rate, Hz; NaN for a single record."""
        length_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / length_ns if length_ns > 0 else float("nan")


@dataclass(slots=True)
class Contents:
    """What one pass over a log gives.

    Attributes
    ----------
    topics : dict of str to TopicCount
        All topics with records, in order of appearance.
    series : dict of str to Series, Frames, HealthSeries or tuple of Event
        Topics that were asked for, in order of appearance.
    start_ns : int
        Earliest ``t_ns`` of samples and estimates, of the rest if there are none, ns.
    damage : Damage
        What could not be read.
    """

    topics: dict[str, TopicCount]
    series: dict[str, TopicArrays]
    start_ns: int
    damage: Damage


def read_contents(reader: LogReader, topics: Collection[str] | None) -> Contents:
    """Return the contents of a log; of other topics than those asked for the count alone."""
    run = _Pass(reader, topics)
    for found in reader.raw_messages(_is_record):
        run.take(found)
    return run.contents()


def _is_record(_: Channel, schema: Schema | None) -> bool:
    return schema is not None and schema.name in DECODER_OF


class _Pass:
    def __init__(self, reader: LogReader, topics: Collection[str] | None) -> None:
        self._reader, self._patterns = reader, topics
        self._counts: dict[str, TopicCount] = {}
        self._takers: dict[str, Callable[[RawChannelMessage], None]] = {}
        self._series: dict[str, SeriesCollector] = {}
        self._frames: dict[str, FrameCollector] = {}
        self._health: dict[str, HealthCollector] = {}
        self._events: dict[str, list[Event]] = {}
        self._undecodable = 0

    def take(self, found: RawChannelMessage) -> None:
        """Take one message."""
        topic = found.channel.topic
        taker = self._takers.get(topic)
        if taker is None:
            taker = self._takers[topic] = self._taker(found)
        try:
            taker(found)
        except (DecodeError, ValueError):
            self._undecodable += 1
            return
        arrival_ns = found.message.log_ns - self._reader.utc_offset_ns
        count = self._counts.setdefault(topic, TopicCount(0, arrival_ns, arrival_ns))
        count.count += 1
        count.last_ns = arrival_ns

    def _taker(self, found: RawChannelMessage) -> Callable[[RawChannelMessage], None]:
        """Return what takes the messages of a topic; one that nobody asked for is not decoded."""
        topic, schema = found.channel.topic, found.schema
        assert schema is not None
        if self._patterns is not None and not any(fnmatchcase(topic, p) for p in self._patterns):
            return lambda _: None
        if schema.name == IMAGE_SCHEMA:
            self._frames[topic] = FrameCollector(self._reader, found)
            return self._frames[topic].take
        decode, utc_offset_ns = DECODER_OF[schema.name], self._reader.utc_offset_ns

        def take(found: RawChannelMessage) -> None:
            message = found.message
            record = decode(message.data, message.sequence, utc_offset_ns)
            self._keep(topic, record, message.log_ns - utc_offset_ns)

        return take

    def _keep(self, topic: str, record: Any, arrival_ns: int) -> None:
        if isinstance(record, Health):
            self._health.setdefault(topic, HealthCollector()).take(record, arrival_ns)
        elif isinstance(record, Event):
            self._events.setdefault(topic, []).append(record)
        elif type(record) in KEPT:
            collector = self._series.get(topic)
            if collector is None:
                collector = self._series[topic] = SeriesCollector(topic, record)
            collector.take(record, arrival_ns)

    def contents(self) -> Contents:
        """Return what was taken; nothing can be taken after that."""
        start_ns = self._start_ns()
        arrays: dict[str, TopicArrays] = {
            **{topic: one.series(start_ns) for topic, one in self._series.items()},
            **{topic: one.frames(start_ns) for topic, one in self._frames.items()},
            **{topic: one.series() for topic, one in self._health.items()},
            **{topic: tuple(events) for topic, events in self._events.items()},
        }
        damage = self._reader.damage
        damage.undecodable += self._undecodable
        ordered = {topic: arrays[topic] for topic in self._counts if topic in arrays}
        return Contents(self._counts, ordered, start_ns, damage)

    def _start_ns(self) -> int:
        collectors = self._series.values()
        first = [one.times() for one in collectors if one.record in STARTING]
        if not first:
            first = [one.times() for one in collectors]
            first += [one.times() for one in self._frames.values()]
        return min((int(times.min()) for times in first if times.size), default=0)
