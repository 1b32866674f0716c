"""What the pipeline has to write, in order, while the rows of some ticks are made together."""

from avionics.rows import RowMaker, Seen, Tick
from avionics.topics import Record, Sink, topic_of


class Outbox:
    """Hands records to a sink in the order in which they came, rows included.

    Making the rows of several ticks in one call costs little more than making those of one. Rows
    wait until ``at_once`` ticks have passed, and what is written behind a waiting row waits too.

    Parameters
    ----------
    sink : Sink
        Takes the records.
    rows : RowMaker
        Makes rows of ticks.
    at_once : int
        Ticks whose rows are made together. Groups are counted in time, so that a replay forms the
        same ones.
    """

    def __init__(self, sink: Sink, rows: RowMaker, *, at_once: int) -> None:
        self._sink = sink
        self._rows = rows
        self._at_once = at_once
        self._waiting: list[Tick | Seen | tuple[str, Record, int, int]] = []

    def write(self, topic: str, record: Record, t_ns: int, arrival_ns: int) -> None:
        """Take a record."""
        if self._waiting:
            self._waiting.append((topic, record, t_ns, arrival_ns))
        else:
            self._sink.write(topic, record, t_ns, arrival_ns)

    def tick(self, tick: Tick) -> None:
        """Take a tick whose rows are due."""
        self._waiting.append(tick)
        if (tick.number + 1) % self._at_once == 0:
            self.flush()

    def seen(self, seen: Seen) -> None:
        """Take a frame whose row is due."""
        self._waiting.append(seen)

    def flush(self) -> None:
        """Write everything that waits."""
        ticks = [item for item in self._waiting if isinstance(item, Tick)]
        frames = [item for item in self._waiting if isinstance(item, Seen)]
        if ticks or frames:
            made, filtered = self._rows.together(ticks, frames)
            pairs, singles = iter(made), iter(filtered)
        for item in self._waiting:
            if isinstance(item, Tick):
                for row in next(pairs):
                    self._sink.write(topic_of(row), row, item.t_ns, item.t_ns)
            elif isinstance(item, Seen):
                row = next(singles)
                self._sink.write(topic_of(row), row, item.t_ns, item.now_ns)
            else:
                self._sink.write(*item)
        self._waiting.clear()
