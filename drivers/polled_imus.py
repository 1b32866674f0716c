"""``PolledImus``: the chips of one I2C bus or serial line as a source of samples.

It survives every fault of its bus: a chip that fails is brought up again in the background while
the others are read, and every failure is counted.
"""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from drivers.clock import Clock
from drivers.errors import BusError, DriverError, FrameFormatError
from drivers.events import Event, EventList, Level
from drivers.interfaces import (
    ChipFault,
    I2cBus,
    ImuChip,
    SerialPort,
    SpiDevice,
    StoresCalibration,
)
from drivers.reopening import Reopening
from drivers.samples import ImuSample

RETRY_NS = 100_000_000
CHECK_PERIOD_NS = 1_000_000_000
FAILURES_TO_LOSE = 5


@dataclass(slots=True)
class _Station:
    """One chip and what is being done about it."""

    chip: ImuChip
    bring_up: Iterator[int] | None = None
    wake_ns: int = 0
    check_ns: int = 0
    failures: int = 0
    is_lost: bool = False
    needs_reset: bool = False
    counters: Counter[str] = field(default_factory=Counter)


class PolledImus:
    """Reads the chips of one bus at a fixed rate; a ``Source[ImuSample]``.

    Parameters
    ----------
    chips : sequence of ImuChip
        The chips, in the order in which they are read.
    clock : Clock
        The steady clock; the poll keeps to absolute deadlines on it.
    rate_hz : float
        Samples of each chip a second.
    bus : I2cBus, SpiDevice, SerialPort or None
        What to close in the end.
    name : str
        What the run calls the source.

    Notes
    -----
    ``seq`` is the number of the tick, so a tick without a sample is a step above one.
    """

    def __init__(
        self,
        chips: Sequence[ImuChip],
        clock: Clock,
        rate_hz: float = 100.0,
        *,
        bus: I2cBus | SpiDevice | SerialPort | None = None,
        name: str = "imus",
    ) -> None:
        self.name = name
        self._stations = [_Station(chip, chip.bring_up()) for chip in chips]
        self._clock = clock
        self._period_ns = round(1e9 / rate_hz)
        self._bus = bus
        self._start_ns: int | None = None
        self._tick = 0
        self._ready: deque[ImuSample] = deque()
        self._events = EventList()
        self._ticks_missed = 0
        self._is_open = True

    def open(self) -> None:
        """Bring every chip up and wait for it; without it, ``read`` does so in passing.

        Raises
        ------
        DriverError
            If a chip is missing, is another one, or does not take its settings.
        """
        for station in self._stations:
            for t_ns in station.chip.bring_up():
                self._clock.sleep_until_ns(t_ns)
            self._is_up(station)

    def read(self, timeout_s: float) -> ImuSample | None:
        """Return the next sample, None if none is due within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while not self._ready and self._is_open:
            due_ns = self.next_ns
            if due_ns > deadline_ns:
                if timeout_s > 0:
                    self._clock.sleep_until_ns(deadline_ns)
                return None
            self._clock.sleep_until_ns(due_ns)
            self._step()
        return self._ready.popleft() if self._ready else None

    @property
    def next_ns(self) -> int:
        """When there is something to do next, ns of the steady clock."""
        if self._start_ns is None:
            self._start_ns = self._clock.now_ns()
        tick_ns = self._start_ns + self._tick * self._period_ns
        return min([s.wake_ns for s in self._stations if s.bring_up is not None] + [tick_ns])

    @property
    def counters(self) -> dict[str, int]:
        """All counters, named ``<pod>.<what>``."""
        return {
            f"{source.removeprefix('pod ')}.{name}": count
            for source, group in self.health().items()
            for name, count in group.items()
        }

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source, ``pod 1`` and so on."""
        shared = {"ticks_missed": self._ticks_missed}
        if isinstance(self._bus, Reopening):
            shared["bus_reopened"] = self._bus.reopened
        return {s.chip.name: {**shared, **s.chip.counters, **s.counters} for s in self._stations}

    def chip_ids(self) -> dict[str, bytes]:
        """Return the unique ids of the chips that are up, by ``pod 1`` and so on."""
        return {s.chip.name: s.chip.uid for s in self._stations}

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._events.take()

    def close(self) -> None:
        """Save what fully calibrated chips have learned, release the bus; may be called twice."""
        if self._is_open:
            self._is_open = False
            for station in self._stations:
                if station.bring_up is None:
                    self._save_calibration(station)
        if self._bus is not None:
            self._bus.close()
            self._bus = None

    def _save_calibration(self, station: _Station) -> None:
        chip = station.chip
        if not isinstance(chip, StoresCalibration):
            return
        try:
            if not chip.may_save_calibration():
                return
            for t_ns in chip.save_calibration():
                self._clock.sleep_until_ns(t_ns)
        except DriverError as error:
            self._event(station, "warning", f"calibration not saved: {error}")
        else:
            self._event(station, "info", "calibration saved")

    def _step(self) -> None:
        """Do what is due now: go on with bring-ups, read the others."""
        now_ns = self._clock.now_ns()
        for station in self._stations:
            if station.bring_up is not None and station.wake_ns <= now_ns:
                self._go_on(station)
        assert self._start_ns is not None
        if self._start_ns + self._tick * self._period_ns > self._clock.now_ns():
            return
        self._skip_missed_ticks()
        seq = self._tick
        self._tick += 1
        for station in self._stations:
            if station.bring_up is None:
                self._poll(station, seq)

    def _skip_missed_ticks(self) -> None:
        assert self._start_ns is not None
        latest = (self._clock.now_ns() - self._start_ns) // self._period_ns
        self._ticks_missed += latest - self._tick
        self._tick = latest

    def _poll(self, station: _Station, seq: int) -> None:
        chip = station.chip
        try:
            sample = chip.read(seq)
            now_ns = self._clock.now_ns()
            is_check_due = now_ns >= station.check_ns
            if chip.is_doubtful or is_check_due:
                station.check_ns = now_ns + CHECK_PERIOD_NS
                fault = chip.fault()
                if fault is not None:
                    self._heal(station, fault)
                    return
        except (BusError, FrameFormatError) as error:
            self._failed(station, error)
            return
        station.failures = 0
        if sample is not None:
            self._ready.append(sample)

    def _failed(self, station: _Station, error: DriverError) -> None:
        station.counters["read_failed"] += 1
        station.failures += 1
        if station.failures >= FAILURES_TO_LOSE:
            station.is_lost = True
            why = f"no answer in {station.failures} ticks: {error}"
            self._heal(station, ChipFault(why))

    def _heal(self, station: _Station, fault: ChipFault) -> None:
        station.counters["reinitialised"] += 1
        station.needs_reset |= fault.needs_reset
        self._event(station, "warning", f"{fault.what}; bringing it up again")
        self._restart(station, self._clock.now_ns())

    def _restart(self, station: _Station, wake_ns: int) -> None:
        station.bring_up = station.chip.bring_up(reset=station.needs_reset)
        station.wake_ns = wake_ns

    def _go_on(self, station: _Station) -> None:
        assert station.bring_up is not None
        try:
            station.wake_ns = next(station.bring_up)
        except StopIteration:
            self._is_up(station)
        except DriverError as error:
            station.counters["bring_up_failed"] += 1
            if not station.is_lost:
                station.is_lost = True
                self._event(station, "error", f"{error}; trying again every {RETRY_NS // 10**6} ms")
            self._restart(station, self._clock.now_ns() + RETRY_NS)

    def _is_up(self, station: _Station) -> None:
        station.bring_up = None
        station.failures = 0
        station.is_lost = station.needs_reset = False
        # Staggered: two checks in one tick would make the next one late.
        stagger_ns = self._stations.index(station) * 2 * self._period_ns
        station.check_ns = self._clock.now_ns() + CHECK_PERIOD_NS + stagger_ns
        uid = station.chip.uid
        self._event(station, "info", f"is up; chip {uid.hex()}" if uid else "is up")

    def _event(self, station: _Station, level: Level, message: str) -> None:
        self._events.add(self._clock.now_ns(), station.chip.name, level, message)
