"""Counters by source, and the events that mark a change of state."""

from collections import defaultdict
from typing import Literal

from avionics.records import Event, Health
from avionics.topics import Sink

Level = Literal["info", "warning", "error"]


class HealthLog:
    """Counts what happens to every source; writes the counters once a second.

    Parameters
    ----------
    sink : Sink
        Takes the records.
    period_ns : int
        Time between two records of the counters, ns.
    """

    def __init__(self, sink: Sink, period_ns: int = 1_000_000_000) -> None:
        self._sink = sink
        self._period_ns = period_ns
        self._counters: dict[str, dict[str, int]] = {}
        self._due_ns: int | None = None

    def declare(self, source: str, *names: str) -> None:
        """Name counters that are to appear even while they are zero."""
        counters = self._counters.setdefault(source, defaultdict(int))
        for name in names:
            counters[name] += 0

    def count(self, source: str, name: str, number: int = 1) -> None:
        """Add to a counter."""
        if source not in self._counters:
            self.declare(source)
        self._counters[source][name] += number

    def write_counters(self, now_ns: int, *, is_last: bool = False) -> None:
        """Write one record per source if a period has passed, or for the last time."""
        if self._due_ns is None:
            self._due_ns = (now_ns // self._period_ns + 1) * self._period_ns
        if now_ns < self._due_ns and not is_last:
            return
        self._due_ns = (now_ns // self._period_ns + 1) * self._period_ns
        for source, counters in self._counters.items():
            self._sink.write(Health(now_ns, source, dict(counters)), now_ns)

    def report(self, source: str, level: Level, message: str, now_ns: int) -> None:
        """Write an event of a source."""
        self._sink.write(Event(now_ns, source, level, message), now_ns)
