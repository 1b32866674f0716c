"""One ICM-42688-P: bring-up, burst reads with screening, and the watch over its state.

Nothing here waits: what takes time is a generator of instants, and the owner of the bus decides
how to spend them.
"""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from drivers.burst import BurstLine, Words, agree
from drivers.burst_time import BurstTime
from drivers.clock import Clock
from drivers.errors import BusError, FrameFormatError
from drivers.icm42688 import registers as reg
from drivers.icm42688.bring_up import BringUp, wrong_setting
from drivers.icm42688.settings import Settings
from drivers.icm42688.spi_port import SpiRegisterPort
from drivers.interfaces import ChipFault
from drivers.register_port import RegisterPort
from drivers.repeats import Repeats
from drivers.samples import ImuSample

# Departures from the motion, rad/s and m/s^2. A second look costs one burst, 0.2 ms over SPI, so a
# manoeuvre may pass the first: a false bit 7 is 0.14 rad/s at 2000 deg/s. The second is what a
# wing may do between two bursts.
LOOK_AGAIN = (0.1, 5.0)
LARGEST_STEP = (3.5, 60.0)


class Icm42688:
    """One chip.

    Parameters
    ----------
    port : RegisterPort
        How its registers are reached.
    clock : Clock
        The steady clock.
    pod : str
        Identifier that the samples carry.
    settings : Settings
        Ranges, rate, low-pass.

    Notes
    -----
    A burst holds the data of one sample and the interrupt status behind them, which says whether
    the chip has been reset since the last burst.
    """

    def __init__(
        self, port: RegisterPort, clock: Clock, *, pod: str, settings: Settings | None = None
    ) -> None:
        self.pod = pod
        self.settings = settings if settings is not None else Settings()
        self._counters: Counter[str] = Counter()
        self._port = port
        self._clock = clock
        self._wanted = self.settings.configuration(is_spi=isinstance(port, SpiRegisterPort))
        has_accel = self.settings.has_accel
        self._first = reg.ACCEL_DATA if has_accel else reg.GYRO_DATA
        self._length = reg.INT_STATUS + 1 - self._first
        self._look_again = self._limits(*LOOK_AGAIN)
        self._largest_step = self._limits(*LARGEST_STEP)
        self._line = BurstLine()
        self._repeats = Repeats(has_accel=has_accel, counters=self._counters)
        self._was_reset = self._is_dead = self._is_vague = False
        self._forget()

    def _limits(self, rate_rad_s: float, force_m_s2: float) -> Words:
        rate = [round(rate_rad_s / self.settings.gyro_scale_rad_s)] * 3
        force = [round(force_m_s2 / self.settings.accel_scale_m_s2)] * 3
        return np.array(force + rate if self.settings.has_accel else rate, dtype=np.int32)

    @property
    def name(self) -> str:
        """What messages and counters call the chip."""
        return f"pod {self.pod}"

    @property
    def uid(self) -> bytes:
        """Nothing: the chip has no serial number that a host could read."""
        return b""

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the chip and of its port together."""
        return dict(self._counters + self._port.counters)

    @property
    def delay_s(self) -> float:
        """Mean age of a rate when it is read, s, with the settings that were read back."""
        return self.settings.delay.mean_s

    @property
    def delay_spread_s(self) -> float:
        """Half of the interval, s, over which that age is spread evenly."""
        return self.settings.delay.spread_s

    def bring_up(self, *, reset: bool = False) -> Iterator[int]:
        """Identify, reset in any case, configure and verify; yields the times to go on at.

        Raises
        ------
        DriverError
            If the chip is not there, is another one, or does not take its settings.
        """
        sequence = BringUp(
            self._port,
            self._clock,
            name=self.name,
            settings=self.settings,
            counters=self._counters,
        )
        yield from sequence.steps()
        self._forget()

    def read(self, seq: int) -> ImuSample | None:
        """Return one screened sample, or None if what came was invalid or late (and counted).

        Parameters
        ----------
        seq : int
            Sequence number that the sample gets.

        Raises
        ------
        BusError, FrameFormatError
            If the burst and its repetition failed.
        """
        t_ns, values = self._burst()
        if not self._is_valid(values):
            return None
        expected = self._line.expected(t_ns)
        if expected is not None and not agree(values, expected, self._look_again):
            second = self._second_look(values, expected)
            if second is None:
                return None
            t_ns, values = second
        if not self._repeats.pass_on(values, self._line.last):
            return None
        if self._is_vague:
            self._counters["read_slow"] += 1
            return None
        self._line.remember(t_ns, values)
        self._counters["samples"] += 1
        self._counters["saturated"] += _is_saturated(values[-3:])
        return self._sample(t_ns, seq, values)

    @property
    def is_doubtful(self) -> bool:
        """Whether the last data call for ``fault`` now."""
        return self._was_reset or self._repeats.is_doubtful or self._repeats.is_frozen

    def fault(self) -> ChipFault | None:
        """Return what is wrong with the chip, or None; to be asked about once a second.

        Raises
        ------
        BusError, FrameFormatError
            If it cannot be asked.
        """
        if self._repeats.is_frozen:
            self._repeats.wait_longer()
            self._counters["frozen"] += 1
            return ChipFault("data do not move", needs_reset=True)
        was_reset, self._was_reset = self._was_reset, False
        self._repeats.is_doubtful = False
        wrong = self._wrong_state()
        if wrong is None or self._wrong_state() != wrong:  # else a false bit in one read
            return None
        self._counters["resets"] += was_reset
        return ChipFault(f"the chip was reset: {wrong}" if was_reset else wrong)

    def _wrong_state(self) -> str | None:
        """Return which register reads what it should not, or None; puts a wrong bank back."""
        chip_id, bank = self._port.read(reg.CHIP_ID, 2)
        if 1 <= bank <= reg.HIGHEST_BANK:
            self._counters["wrong_bank"] += 1
            self._port.write(reg.BANK_SEL, b"\x00")
            self._forget()
            return None
        if chip_id != reg.CHIP_ID_VALUE:
            return f"chip id 0x{chip_id:02X}, expected 0x{reg.CHIP_ID_VALUE:02X}"
        wrong = wrong_setting(self._port, self._wanted)
        if wrong is None:
            self._repeats.verified()
        return wrong

    def _forget(self) -> None:
        self._was_reset = False
        self._line.forget()
        self._repeats.forget()
        self._burst_time = BurstTime(self._length, self._port.address_bytes)

    def _burst(self) -> tuple[int, Words]:
        """Return when the chip gave its data, ns, and the words, accelerometer first.

        A burst is of one sample: the data registers are read in step with the interface (SYNCR,
        Sec. 13.1).
        """
        before_ns = self._clock.now_ns()
        try:
            data = self._port.read(self._first, self._length)
        except (BusError, FrameFormatError):
            self._counters["retries"] += 1
            before_ns = self._clock.now_ns()
            data = self._port.read(self._first, self._length)
        taken_ns = self._port.taken_ns
        if taken_ns is None:
            taken_ns, self._is_vague = self._burst_time.taken_ns(before_ns, self._clock.now_ns())
        self._is_dead = data == b"\xff" * self._length
        self._was_reset = bool(data[-1] & reg.RESET_DONE) and not self._is_dead
        end = len(self._look_again) * 2
        return taken_ns, np.frombuffer(data[:end], dtype=">i2").astype(np.int32)

    def _is_valid(self, values: Words) -> bool:
        """Count and refuse what is no measurement: a line that reads ones, no sample yet."""
        if self._was_reset:
            return False
        if self._is_dead:
            what = "all_ones"
        elif bool((values == reg.INVALID).any()):
            what = "invalid"
        else:
            return True
        self._counters[what] += 1
        self._repeats.is_doubtful = True
        return False

    def _second_look(self, values: Words, expected: Words) -> tuple[int, Words] | None:
        """Return a burst to use after one that departs from the motion."""
        t_ns, second = self._burst()
        if not self._is_valid(second):
            return None
        if agree(second, expected, self._look_again):
            self._counters["spikes"] += not agree(values, second, self._look_again)
            return t_ns, second
        if agree(second, values, self._largest_step):
            return t_ns, second  # the wing did move like this
        self._counters["rejected"] += 1
        return None

    def _sample(self, t_ns: int, seq: int, values: Words) -> ImuSample:
        real = values.astype(np.float64)
        rate = real[-3:] * self.settings.gyro_scale_rad_s
        has_accel = self.settings.has_accel
        force = real[:3] * self.settings.accel_scale_m_s2 if has_accel else None
        return ImuSample(t_ns, self.pod, seq, rate, force)


def _is_saturated(rate: Words) -> bool:
    """Whether some rate stands at the end of the range: the wing may turn faster."""
    return bool(((rate <= reg.LOWEST_VALID) | (rate >= reg.HIGHEST_VALID)).any())
