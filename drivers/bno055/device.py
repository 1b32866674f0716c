"""One BNO055: bring-up, burst reads with screening, and the watch over its state.

Nothing here waits: what takes time is a generator of instants, and the owner of the bus decides
how to spend them.
"""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from drivers.bno055 import registers as reg
from drivers.bno055.bring_up import BringUp, ChipState
from drivers.bno055.calibration import CalibrationStore, is_complete, read_offsets
from drivers.bno055.screening import is_suspicious, words
from drivers.bno055.settings import Settings
from drivers.burst import BurstLine, Words, agree
from drivers.burst_time import BurstTime
from drivers.clock import Clock
from drivers.errors import BusError, DriverError, FrameFormatError
from drivers.interfaces import ChipFault
from drivers.register_port import RegisterPort
from drivers.repeats import Repeats
from drivers.samples import ImuSample

# A second look costs one burst, so these may be passed by a hard manoeuvre.
GYRO_STEP_RAD_S = 3.5
ACCEL_STEP_M_S2 = 60.0


class Bno055:
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
        Mode, range, bandwidth, crystal.
    calibrations : CalibrationStore or None
        Where calibration offsets are kept by chip.
    """

    def __init__(
        self,
        port: RegisterPort,
        clock: Clock,
        *,
        pod: str,
        settings: Settings | None = None,
        calibrations: CalibrationStore | None = None,
    ) -> None:
        self.pod = pod
        self.settings = settings if settings is not None else Settings()
        self._counters: Counter[str] = Counter()
        self.state: ChipState | None = None
        self._port = port
        self._clock = clock
        self._calibrations = calibrations
        mode = self.settings.mode
        self._first = reg.ACC_DATA if mode.has_accel else reg.GYR_DATA
        self._length = reg.GYR_DATA + 6 - self._first
        gyro_step = round(GYRO_STEP_RAD_S / self.settings.gyro_scale_rad_s)
        limits = [gyro_step] * 3
        if mode.has_accel:
            accel_step = round(ACCEL_STEP_M_S2 / reg.ACCEL_SCALE_M_S2)
            limits = [accel_step] * 3 + [1 << 16] * 3 + limits
        self._step_limit: Words = np.array(limits, dtype=np.int32)
        self._line = BurstLine()
        self._repeats = Repeats(has_accel=mode.has_accel, counters=self._counters)
        self._is_vague = False
        self._forget()

    @property
    def name(self) -> str:
        """What messages and counters call the chip."""
        return f"pod {self.pod}"

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the chip and of its port together."""
        return dict(self._counters + self._port.counters)

    @property
    def uid(self) -> bytes:
        """Unique id of the chip, 16 bytes; empty while it is not up."""
        return b"" if self.state is None else self.state.uid

    @property
    def delay_s(self) -> float:
        """Mean age of a rate when it is read, s, in the mode that was read back."""
        return self.settings.delay.mean_s

    @property
    def delay_spread_s(self) -> float:
        """Half of the interval, s, over which that age is spread evenly."""
        return self.settings.delay.spread_s

    def bring_up(self, *, reset: bool = False) -> Iterator[int]:
        """Identify, configure and verify; yields the steady times at which to go on.

        Raises
        ------
        DriverError
            If the chip is not there, is another one, or does not take its settings.
        """
        self.state = None
        sequence = BringUp(
            self._port,
            self._clock,
            name=self.name,
            settings=self.settings,
            calibrations=self._calibrations,
            counters=self._counters,
        )
        yield from sequence.steps(reset=reset)
        self.state = sequence.state
        self._forget()

    def open(self, *, reset: bool = False) -> None:
        """Bring the chip up and wait for it.

        Raises
        ------
        DriverError
            As ``bring_up``.
        """
        for t_ns in self.bring_up(reset=reset):
            self._clock.sleep_until_ns(t_ns)

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
        expected = self._line.expected(t_ns)
        if expected is not None and is_suspicious(values, expected, self._step_limit):
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
        return self._sample(t_ns, seq, values)

    def fault(self) -> ChipFault | None:
        """Return what is wrong with the chip, or None; to be asked about once a second.

        Raises
        ------
        BusError, FrameFormatError
            If it cannot be asked.
        """
        if self._repeats.is_frozen:  # needs a reset whatever the registers say
            self._repeats.wait_longer()
            self._counters["frozen"] += 1
            return ChipFault("data do not move", needs_reset=True)
        wrong = self._wrong_state()
        return None if wrong is None else ChipFault(wrong)

    def _wrong_state(self) -> str | None:
        """Return which register reads what it should not, or None."""
        self._repeats.is_doubtful = False
        if self._put_page_back():
            return None
        block = self._port.read(reg.SYS_STATUS, reg.PWR_MODE - reg.SYS_STATUS + 1)
        error = block[reg.SYS_ERR - reg.SYS_STATUS]
        mode = block[reg.OPR_MODE - reg.SYS_STATUS] & 0x0F
        units = block[reg.UNIT_SEL - reg.SYS_STATUS]
        if mode != self.settings.mode:
            return f"OPR_MODE reads 0x{mode:02X}, expected 0x{self.settings.mode:02X}"
        if error:
            return f"SYS_ERR reads 0x{error:02X}, expected 0x00"
        if units != reg.UNITS:
            return f"UNIT_SEL reads 0x{units:02X}, expected 0x{reg.UNITS:02X}"
        self._repeats.verified()
        return None

    @property
    def is_doubtful(self) -> bool:
        """Whether the last data call for ``fault`` now."""
        return self._repeats.is_doubtful or self._repeats.is_frozen

    def may_save_calibration(self) -> bool:
        """Return whether there is a store and the chip says that it is fully calibrated.

        Raises
        ------
        BusError, FrameFormatError
            If it cannot be asked.
        """
        if self._calibrations is None or self.state is None:
            return False
        return is_complete(self._port.read(reg.CALIB_STAT, 1)[0], self.settings.mode)

    def save_calibration(self) -> Iterator[int]:
        """Store the present offsets under the chip's id; yields instants to wait for.

        The chip shows them in CONFIG mode only, so about 40 ms of samples are lost.

        Raises
        ------
        DriverError
            If there is no store, the chip is not up, or the bus fails.
        """
        if self._calibrations is None or self.state is None:
            msg = f"{self.name}: no calibration store, or the chip is not up"
            raise DriverError(msg)
        block = yield from read_offsets(self._port, self._clock, self.settings.mode)
        self._calibrations.save(self.state.uid, block)

    def _forget(self) -> None:
        self._line.forget()
        self._repeats.forget()
        self._burst_time = BurstTime(self._length, self._port.address_bytes)

    def _burst(self) -> tuple[int, Words]:
        """Return when the chip took its data, ns, and the words.

        A burst is of one piece: the chip takes it when the data begin, after three bytes of
        addresses on I2C and with the end of the request on UART.
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
        return taken_ns, words(data)

    def _second_look(self, values: Words, expected: Words) -> tuple[int, Words] | None:
        """Return a burst to use after a suspicious one."""
        t_ns, second = self._burst()
        if not is_suspicious(second, expected, self._step_limit):
            if is_suspicious(values, second, self._step_limit):
                self._counters["spikes"] += 1
            return t_ns, second
        if agree(second, values, self._step_limit) and not self._put_page_back():
            return t_ns, second  # the wing did move like this
        self._counters["rejected"] += 1
        return None

    def _put_page_back(self) -> bool:
        """Select page 0 if the chip stands on page 1."""
        # Only bit 0: a false bit 7 must not look like a wrong page.
        if not self._port.read(reg.PAGE_ID, 1)[0] & 1:
            return False
        self._counters["wrong_page"] += 1
        self._port.write(reg.PAGE_ID, b"\x00")
        self._forget()
        return True

    def _sample(self, t_ns: int, seq: int, values: Words) -> ImuSample:
        state, mode = self.state, self.settings.mode
        real = values.astype(np.float64)
        rate = real[-3:] * self.settings.gyro_scale_rad_s
        force = real[:3] * reg.ACCEL_SCALE_M_S2 if mode.has_accel else None
        if state is not None:
            rate -= state.gyro_offset_rad_s
            force = None if force is None else force - state.accel_offset_m_s2
        flux = real[3:6] * reg.MAG_SCALE_T if mode.has_mag else None
        return ImuSample(t_ns, self.pod, seq, rate, force, flux)
