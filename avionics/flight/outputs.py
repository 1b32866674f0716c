"""What leaves the pipelines: records and rows in their order, to one sink or to several."""

from collections.abc import Sequence

from avionics.flight.estimate_rows import EstimateRows
from avionics.topics import Record, Sink
from avionics.wse.forecast import Forecast
from avionics.wse.update import UpdateResult


class OrderedOutput:
    """Writes records and rows in the order in which they came, the rows of several ticks at once.

    Making the rows of several ticks in one call costs little more than making those of one. Rows
    wait until ``at_once`` ticks have passed, and what is written behind a waiting row waits too.

    Parameters
    ----------
    sink : Sink
        Takes every record.
    at_once : int
        Ticks whose rows are made together. Groups are counted in time, so that a replay forms the
        same ones.
    """

    def __init__(self, sink: Sink, *, at_once: int) -> None:
        self._sink = sink
        self._at_once = at_once
        self._waiting: list[tuple[Record | Forecast | UpdateResult, EstimateRows | None, int]] = []
        self._forecasts: dict[EstimateRows, list[Forecast]] = {}
        self._results: dict[EstimateRows, list[UpdateResult]] = {}

    def write(self, record: Record, arrival_ns: int) -> None:
        """Take a record that arrived at ``arrival_ns``."""
        if self._waiting:
            self._waiting.append((record, None, arrival_ns))
        else:
            self._sink.write(record, arrival_ns)

    def write_tick(self, rows: EstimateRows, forecast: Forecast) -> None:
        """Take a tick of a wing, whose rows ``rows`` will make."""
        self._waiting.append((forecast, rows, forecast.t_ns))
        self._forecasts.setdefault(rows, []).append(forecast)

    def write_update(self, rows: EstimateRows, result: UpdateResult, now_ns: int) -> None:
        """Take an update of a wing, made at ``now_ns``, whose row ``rows`` will make."""
        self._waiting.append((result, rows, now_ns))
        self._results.setdefault(rows, []).append(result)

    def end_tick(self, number: int) -> None:
        """Write what waits if the ``number``-th tick, which every wing has had, ends a group."""
        if (number + 1) % self._at_once == 0:
            self.flush()

    def flush(self) -> None:
        """Write everything that waits."""
        waiting, self._waiting = self._waiting, []
        forecasts, self._forecasts = self._forecasts, {}
        results, self._results = self._results, {}
        wings = [*forecasts, *(rows for rows in results if rows not in forecasts)]
        made = {rows: rows.make(forecasts.get(rows, []), results.get(rows, [])) for rows in wings}
        ticks = {rows: iter(of_ticks) for rows, (of_ticks, _) in made.items()}
        frames = {rows: iter(of_frames) for rows, (_, of_frames) in made.items()}
        for item, rows, arrival_ns in waiting:
            if isinstance(item, Forecast):
                assert rows is not None
                for row in next(ticks[rows]):
                    self._sink.write(row, arrival_ns)
            elif isinstance(item, UpdateResult):
                assert rows is not None
                self._sink.write(next(frames[rows]), arrival_ns)
            else:
                self._sink.write(item, arrival_ns)


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
