"""Two ways to fly one pipeline: lockstep with a stepped clock, live with threads.

Both hand records to the pipeline in one order from one thread; other threads only wait for
hardware or track images. A record's place in that order is what the log keeps, so a replay
repeats it.
"""

import contextlib
import queue
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

from avionics.config import ByCamera, Config, FlightConfig
from avionics.flight.pipelines import Pipelines
from avionics.flight.rig import Rig
from avionics.records import Event, Health, MarkerPrediction, MarkerTracks, Truth
from avionics.topics import Record, Sink
from avionics.tracking import Tracker, make_tracker
from drivers.errors import DriverError
from drivers.events import Level, named_once
from drivers.interfaces import Reporting, Source
from drivers.prompt_threads import prompt_threads
from drivers.samples import Frame, ImuSample

Progress = Callable[[float], None]
AnySource = Source[ImuSample] | Source[Frame] | Source[Truth]

LIVE_QUEUE_RECORDS = 4096
READ_TIMEOUT_S = 0.1
RETRY_S = 0.5
DRIVER = "driver "
"""Before the names of what drivers count and report: the pipeline counts pods on its own."""
HEALTH_PERIOD_NS = 1_000_000_000


class Flight:
    """The synchronous core of every run: pipelines, sink, counters, used from one thread."""

    def __init__(self, rig: Rig, config: FlightConfig, sink: Sink) -> None:
        self._reporting = [s for s in _sources(rig) if isinstance(s, Reporting)]
        self._pipelines = Pipelines(config, sink)
        self._next_health_ns: int | None = None

    def take(self, record: Record, arrival_ns: int) -> None:
        """Hand one record to the pipelines; what no filter has use for passes through them."""
        if isinstance(record, ImuSample):
            self._pipelines.on_imu(record, arrival_ns)
        elif isinstance(record, MarkerTracks):
            self._pipelines.on_tracks(record, arrival_ns)
        else:
            self._pipelines.pass_on(record, arrival_ns)

    def predict(self, frame: Frame) -> MarkerPrediction:
        """Return where the filter of a camera's wing expects the markers in a frame."""
        return self._pipelines.predict_markers(frame.t_ns, frame.camera)

    def pass_time(self, now_ns: int, extra: Counter[str] | None = None) -> None:
        """Let rows fall due; log what the sources have to say, once a second their counters."""
        self._pipelines.advance(now_ns)
        for source in self._reporting:
            for event in source.take_events():
                self.take(replace(event, source=f"{DRIVER}{event.source}"), now_ns)
        if self._next_health_ns is None:
            self._next_health_ns = now_ns + HEALTH_PERIOD_NS
        if now_ns < self._next_health_ns:
            return
        self._next_health_ns += HEALTH_PERIOD_NS
        for source in self._reporting:
            for name, counters in source.health().items():
                self.take(Health(now_ns, f"{DRIVER}{name}", dict(counters)), now_ns)
        if extra:
            self.take(Health(now_ns, "runner", dict(extra)), now_ns)

    def close(self) -> None:
        """End the flight: what the pipeline still holds goes to the sink."""
        self._pipelines.close()


def trackers_for(config: FlightConfig) -> ByCamera[Tracker | None]:
    """Return the tracker of each wing's camera."""
    return ByCamera(config, [tracker_for(each) for each in config.wing_configs])


def tracker_for(config: Config) -> Tracker | None:
    """Return the configured tracker, or None where there is nothing to track."""
    return make_tracker(config) if config.camera is not None and config.markers else None


def run_lockstep(
    rig: Rig,
    config: FlightConfig,
    sink: Sink,
    *,
    duration_s: float,
    step_s: float = 1e-3,
    progress: Progress | None = None,
) -> None:
    """Fly a rig whose clock moves step by step, as fast as the machine can.

    Parameters
    ----------
    rig : Rig
        Its clock's ``sleep_until_ns`` moves time; its sources return what is then due.
    config : Config or WingsConfig
        The configuration that flies.
    sink : Sink
        Takes every record in pipeline order.
    duration_s : float
        Length of the flight, s of the rig's clock.
    step_s : float
        Step of the clock, s: the resolution of arrival times.
    progress : callable, optional
        Called with the seconds flown, ten times a flown second.
    """
    flight, trackers = Flight(rig, config, sink), trackers_for(config)
    start_ns, step_ns = rig.clock.now_ns(), round(step_s * 1e9)
    for step in range(1, round(duration_s / step_s) + 1):
        rig.clock.sleep_until_ns(start_ns + step * step_ns)
        now_ns = rig.clock.now_ns()
        for record in _due(rig):
            now_ns = rig.clock.now_ns()  # a polled chip takes time to read
            flight.take(record, now_ns)
            if not isinstance(record, Frame):
                continue
            tracker = trackers.get(record.camera)
            if tracker is not None:
                flight.take(tracker.update(record, flight.predict(record)), now_ns)
        flight.pass_time(now_ns)
        if progress is not None and step % 100 == 0:
            progress(step * step_s)
    flight.close()


def _sources(rig: Rig) -> list[AnySource]:
    truth: list[AnySource] = [] if rig.truth is None else [rig.truth]
    return [*rig.imus, *rig.cameras, *truth]


def _due(rig: Rig) -> Iterator[Record]:
    for source in _sources(rig):
        while (record := source.read(0)) is not None:
            yield record


def run_live(
    rig: Rig,
    config: FlightConfig,
    sink: Sink,
    *,
    stop: threading.Event,
    duration_s: float | None = None,
    progress: Progress | None = None,
) -> None:
    """Fly real sources until ``stop`` is set or ``duration_s`` has passed.

    A record arrives when this thread takes it from the queue: arrivals never run backwards. A
    source that fails is reported, left alone for a moment and read again; the others fly on. A
    frame that comes while the tracker of its camera is busy is recorded but not tracked, and
    counted.
    """
    live = _Live(rig, config, stop)
    flight = Flight(rig, config, sink)
    start_ns = rig.clock.now_ns()
    with prompt_threads(), live.threads():
        while not stop.is_set():
            record = live.next_record()
            now_ns = rig.clock.now_ns()
            if record is not None:
                flight.take(record, now_ns)
                if isinstance(record, Frame):
                    live.offer_frame(record, flight.predict)
            flight.pass_time(now_ns, live.counters)
            elapsed_s = (now_ns - start_ns) * 1e-9
            if progress is not None:
                progress(elapsed_s)
            if duration_s is not None and elapsed_s >= duration_s:
                stop.set()
    now_ns = rig.clock.now_ns()
    while (record := live.next_record(wait=False)) is not None:
        flight.take(record, now_ns)
    flight.close()


class _Live:
    """The threads of a live run and the queue in front of the pipeline."""

    def __init__(self, rig: Rig, config: FlightConfig, stop: threading.Event) -> None:
        self.counters: Counter[str] = Counter()
        self._rig, self._stop = rig, stop
        # ``queue.Queue`` costs a small machine more than many a record: its waits are Python.
        self._records: queue.SimpleQueue[Record] = queue.SimpleQueue()
        trackers = [tracker_for(each) for each in config.wing_configs]
        self._desks = [None if tracker is None else _Desk(tracker) for tracker in trackers]
        self._desk_of = ByCamera(config, self._desks)

    @contextlib.contextmanager
    def threads(self) -> Iterator[None]:
        """Run one thread a source and one a tracker while the block lasts."""
        threads = [
            threading.Thread(target=self._pump, args=(source,), name=f"source {i}", daemon=True)
            for i, source in enumerate(_sources(self._rig))
        ]
        threads += [
            threading.Thread(target=self._track, args=(desk,), name=f"tracker {i}", daemon=True)
            for i, desk in enumerate(self._desks)
            if desk is not None
        ]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            self._stop.set()
            for thread in threads:
                thread.join(timeout=5.0)

    def next_record(self, *, wait: bool = True) -> Record | None:
        """Return the next record in order of arrival, or None if none came."""
        try:
            return self._records.get(block=wait, timeout=0.02 if wait else None)
        except queue.Empty:
            return None

    def offer_frame(self, frame: Frame, predict: Callable[[Frame], MarkerPrediction]) -> None:
        """Give the tracker of its camera a frame, unless it still has one waiting."""
        desk = self._desk_of.get(frame.camera)
        if desk is None:
            return
        if desk.frames.full():
            self.counters["frames_not_tracked"] += 1
            return
        desk.frames.put((frame, predict(frame)))

    def _put(self, record: Record) -> None:
        if self._records.qsize() >= LIVE_QUEUE_RECORDS:
            self.counters["records_lost_queue_full"] += 1
        else:
            self._records.put(record)

    def _pump(self, source: AnySource) -> None:
        failing = False
        while not self._stop.is_set():
            try:
                record = source.read(READ_TIMEOUT_S)
            except DriverError as error:
                self.counters["source_failures"] += 1
                if not failing:
                    self._report(source, "error", f"{error}; trying again every {RETRY_S} s")
                failing = True
                self._stop.wait(RETRY_S)
                continue
            if failing:
                self._report(source, "info", "answers again")
                failing = False
            if record is not None:
                self._put(record)

    def _report(self, source: AnySource, level: Level, message: str) -> None:
        name = str(getattr(source, "name", type(source).__name__))
        self._put(Event(self._rig.clock.now_ns(), name, level, named_once(name, message)))

    def _track(self, desk: "_Desk") -> None:
        while not self._stop.is_set():
            with contextlib.suppress(queue.Empty):
                frame, prediction = desk.frames.get(timeout=READ_TIMEOUT_S)
                self._put(desk.tracker.update(frame, prediction))


class _Desk:
    """A tracker and the frame that waits for it."""

    def __init__(self, tracker: Tracker) -> None:
        self.tracker = tracker
        self.frames: queue.Queue[tuple[Frame, MarkerPrediction]] = queue.Queue(1)
