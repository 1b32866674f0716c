"""What the pipeline has to write, in order, while the rows of some ticks are made together."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from avionics.flight.estimate_rows import RowBatch, RowMaker, Seen, Tick, row_batch
from avionics.topics import Record, Sink


class Slot(NamedTuple):
    """The place of rows among the records: those of the next tick, or of the next frame.

    Attributes
    ----------
    wing : int
        Whose they are.
    is_tick : bool
        Whether they are a tick's.
    t_ns, now_ns : int
        When they were true, and when they were made, ns.
    """

    wing: int
    is_tick: bool
    t_ns: int
    now_ns: int


Item = Slot | tuple[Record, int]
"""Rows that are still to be made, or a record and its arrival, ns."""


@runtime_checkable
class BatchSink(Protocol):
    """A sink that makes the rows itself, such as one in another process."""

    def take(self, batches: Sequence[RowBatch], items: Sequence[Item]) -> None:
        """Write records in order, and the rows of each wing in their places among them."""
        ...


class RowWriter:
    """Makes rows and hands them to a sink with the records among which they stand.

    Parameters
    ----------
    rows : sequence of RowMaker
        Make the rows, one a wing.
    sink : Sink
        Takes every record.
    """

    def __init__(self, rows: Sequence[RowMaker], sink: Sink) -> None:
        self._rows = rows
        self._sink = sink

    def take(self, batches: Sequence[RowBatch], items: Sequence[Item]) -> None:
        """Write records in order, and the rows of each wing in their places among them."""
        made = [
            (iter(pairs), iter(singles))
            for maker, batch in zip(self._rows, batches, strict=True)
            for pairs, singles in [maker.together(batch)]
        ]
        for item in items:
            if isinstance(item, Slot):
                pairs, singles = made[item.wing]
                for row in next(pairs) if item.is_tick else (next(singles),):
                    self._sink.write(row, item.now_ns)
            else:
                self._sink.write(*item)


class Outbox:
    """Hands on what is to be written in the order in which it came, rows included.

    Making the rows of several ticks in one call costs little more than making those of one. Rows
    wait until ``at_once`` ticks have passed, and what is written behind a waiting row waits too.

    Parameters
    ----------
    sink : BatchSink
        Takes rows and records.
    wings : int
        How many wings' rows there are.
    at_once : int
        Ticks whose rows are made together. Groups are counted in time, so that a replay forms the
        same ones.
    """

    def __init__(self, sink: BatchSink, *, wings: int, at_once: int) -> None:
        self._sink = sink
        self._at_once = at_once
        self._items: list[Item] = []
        self._ticks: list[list[Tick]] = [[] for _ in range(wings)]
        self._seen: list[list[Seen]] = [[] for _ in range(wings)]
        self._has_rows = False

    def write(self, record: Record, arrival_ns: int) -> None:
        """Take a record."""
        self._items.append((record, arrival_ns))
        if not self._has_rows:
            self.flush()

    def tick(self, tick: Tick, wing: int) -> None:
        """Take a tick whose rows are due."""
        self._items.append(Slot(wing, is_tick=True, t_ns=tick.t_ns, now_ns=tick.t_ns))
        self._ticks[wing].append(tick)
        self._has_rows = True

    def end_tick(self, number: int) -> None:
        """Hand on what waits if the tick that every wing has had ends a group."""
        if (number + 1) % self._at_once == 0:
            self.flush()

    def seen(self, seen: Seen, wing: int) -> None:
        """Take a frame whose row is due."""
        self._items.append(Slot(wing, is_tick=False, t_ns=seen.t_ns, now_ns=seen.now_ns))
        self._seen[wing].append(seen)
        self._has_rows = True

    def flush(self) -> None:
        """Hand on everything that waits."""
        items, ticks, seen = self._items, self._ticks, self._seen
        self._items = []
        self._ticks, self._seen = [[] for _ in ticks], [[] for _ in seen]
        self._has_rows = False
        self._sink.take([row_batch(*rows) for rows in zip(ticks, seen, strict=True)], items)


class FanOut:
    """A sink that hands every record to several others, in the order in which they are given.

    Parameters
    ----------
    sinks : sequence of Sink
        The recorder, a live view, an output to a bus, ...; none of them may block or raise
        because of its own trouble: the next ones would go without the record.
    """

    def __init__(self, sinks: Sequence[Sink]) -> None:
        self._sinks = tuple(sinks)

    def write(self, record: Record, arrival_ns: int) -> None:
        """Hand one record that arrived at ``arrival_ns`` to every sink."""
        for sink in self._sinks:
            sink.write(record, arrival_ns)
