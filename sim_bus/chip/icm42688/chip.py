"""The simulated ICM-42688-P: one register-true chip behind I2C and SPI.

Five register banks, reset, start-up times, the filters' delays, invalid data until the first
sample, and the data sheet's prohibitions, which are kept and noted. What the registers leave out:
FIFO, interrupt pins, time stamps, motion detection, self-test, the adaptive full-scale range, the
notch and the settings of the anti-alias filter are stored, not acted on; the accelerometer latches
with the gyro. The phase of its clock is its own.
"""

import numpy as np

from sim_bus.chip.icm42688 import registers as reg
from sim_bus.chip.icm42688.signal_path import SignalPath, data_registers
from sim_bus.chip.sensing import ImuErrors, ImuGrade, Motion, Sensing
from sim_bus.chip.sim_chip import ChipSilentError

# Sec. 3.1, 3.2 and 4.10; the drift of the offset is a fair chip's.
GRADE = ImuGrade(
    gyro_noise_dps_sqrthz=0.0028, gyro_offset_dps=0.5, gyro_offset_dps_per_k=0.005,
    gyro_scale=0.005, acc_noise_m_s2_sqrthz=7e-4, acc_offset_m_s2=0.2, clock_ppm=5000.0,
)  # fmt: skip
READ, ADDRESS = 0x80, 0x7F


class SimIcm42688:
    """An ICM-42688-P at the level of its registers.

    Parameters
    ----------
    motion : Motion
        What moves the chip.
    rng : numpy.random.Generator
        Its errors and its noise.
    grade : ImuGrade
        How good a chip it is.
    power_on_ns : int
        When it was switched on, ns; it answers 4 ms later unless ``is_booted``.
    is_booted : bool
        Whether the power-up is over at ``power_on_ns``.

    Attributes
    ----------
    violations : list of str
        What the host did that the data sheet forbids; such a write is lost.
    """

    stretches_clock = False

    def __init__(
        self,
        motion: Motion,
        rng: np.random.Generator,
        *,
        grade: ImuGrade | None = None,
        power_on_ns: int = 0,
        is_booted: bool = True,
    ) -> None:
        self.errors = ImuErrors.draw(GRADE if grade is None else grade, rng)
        self.sensing = Sensing(motion, self.errors, rng, power_on_ns)
        self.violations: list[str] = []
        self.freeze_until_ns = self.zero_until_ns = power_on_ns
        self._silent_until_ns = power_on_ns if is_booted else power_on_ns + reg.POWER_UP_NS
        self._banks = tuple(bytearray(128) for _ in range(reg.BANKS))
        self._load_defaults()

    def _load_defaults(self) -> None:
        for bank, values in zip(self._banks, reg.RESET, strict=True):
            bank[:] = bytes(128)
            for register, value in values.items():
                bank[register] = value
        self._bank = 0
        self._latched, self._seen = -1, -1
        self._gyro_on_ns: int | None = None
        self._accel_on_ns: int | None = None
        self._quiet_until_ns = 0
        self._clear_data()

    def _clear_data(self) -> None:
        """Fill the data registers as before the first sample (Sec. 12.8)."""
        holds_last = self._banks[0][reg.INTF_CONFIG0] & reg.HOLD_LAST
        word = (0 if holds_last else reg.INVALID).to_bytes(2, "big", signed=True)
        self._banks[0][reg.DATA_FIRST : reg.DATA_LAST + 1] = word * 7

    @property
    def path(self) -> SignalPath:
        """What the registers make of the signal now."""
        return SignalPath.of(self._banks[0])

    # What the buses call.

    def read(self, register: int, length: int, t_ns: int) -> bytes:
        """Return ``length`` bytes from ``register`` on, as read over I2C at ``t_ns``.

        Raises
        ------
        ChipSilentError
            While the chip is in reset or without power, or if its I2C interface is switched off.
        """
        self._answer(t_ns, reg.I2C_DISABLED)
        return self._read(register, length, t_ns)

    def write(self, register: int, data: bytes, t_ns: int) -> None:
        """Write ``data`` from ``register`` on over I2C at ``t_ns``; see ``read`` for errors."""
        self._answer(t_ns, reg.I2C_DISABLED)
        for offset, value in enumerate(data):
            self._write_byte(register + offset, value, t_ns)

    def transfer(self, sent: bytes, t_ns: int) -> bytes:
        """Return what the chip sends while it receives ``sent`` over SPI (Sec. 9.6).

        A read may be a burst; of a write only the first byte counts. What nobody drives reads 1.
        """
        try:
            self._answer(t_ns, reg.SPI_DISABLED)
        except ChipSilentError:
            return b"\xff" * len(sent)
        register = sent[0] & ADDRESS
        if sent[0] & READ:
            return b"\x00" + self._read(register, len(sent) - 1, t_ns)
        if len(sent) > 2:
            self.violations.append(f"burst write of register 0x{register:02X} over SPI")
        self._write_byte(register, sent[1], t_ns)
        return bytes(len(sent))

    # Faults.

    def brown_out(self, t_ns: int, silent_ns: int = reg.POWER_UP_NS) -> None:
        """Lose power for a moment: silent, then asleep with reset values and no data."""
        self._load_defaults()
        self._silent_until_ns = t_ns + silent_ns

    def select_page(self, page: int) -> None:
        """Leave the bank register where a crashed program left it."""
        self._bank = page & 0x07

    # Inside.

    def _answer(self, t_ns: int, disabled: int) -> None:
        if t_ns < self._silent_until_ns:
            msg = f"chip is in reset for {(self._silent_until_ns - t_ns) * 1e-6:.2f} ms more"
            raise ChipSilentError(msg)
        if self._banks[0][reg.INTF_CONFIG0] & 0x03 == disabled:
            msg = "this interface of the chip is switched off (UI_SIFS_CFG)"
            raise ChipSilentError(msg)

    def _read(self, register: int, length: int, t_ns: int) -> bytes:
        """Read a burst; the data of one sample, whenever the burst ends."""
        first = self._banks[0]
        self._refresh(t_ns)
        if self._latched > self._seen:
            first[reg.INT_STATUS] |= reg.DATA_READY
        data = bytearray()
        for address in (a & ADDRESS for a in range(register, register + length)):
            if address == reg.REG_BANK_SEL:
                data.append(self._bank)
            elif self._bank >= reg.BANKS:
                data.append(0)
            else:
                data.append(self._banks[self._bank][address])
            if address == reg.INT_STATUS and self._bank == 0:
                first[reg.INT_STATUS] = 0
                self._seen = self._latched
        return bytes(data)

    def _write_byte(self, register: int, value: int, t_ns: int) -> None:
        if t_ns < self._quiet_until_ns:
            self.violations.append(f"write of 0x{register:02X} within 200 us of a sensor's start")
            return
        if register == reg.REG_BANK_SEL:
            self._bank = value & 0x07
            return
        if self._bank >= reg.BANKS or register not in reg.WRITABLE[self._bank]:
            return
        is_free = self._bank == 0 and register in reg.WRITABLE_RUNNING
        if self._runs and not is_free:
            self.violations.append(f"write of bank {self._bank} 0x{register:02X} while running")
            return
        if self._bank == 0 and register == reg.DEVICE_CONFIG and value & 0x01:
            self.brown_out(t_ns, reg.RESET_NS)
            return
        if self._bank == 0 and register == reg.PWR_MGMT0:
            self._switch(value, t_ns)
        self._banks[self._bank][register] = value
        if self._bank == 0 and register == reg.INTF_CONFIG0 and self._latched < 0:
            self._clear_data()

    @property
    def _runs(self) -> bool:
        return bool(self._banks[0][reg.PWR_MGMT0] & 0x0F)

    def _switch(self, value: int, t_ns: int) -> None:
        """Start and stop the sensors; both wake to data some time later."""
        before = self._banks[0][reg.PWR_MGMT0]
        gyro, accel = value >> 2 & 0x03, value & 0x03
        if (gyro and not before >> 2 & 0x03) or (accel >= 2 and before & 0x03 < 2):
            self._quiet_until_ns = t_ns + reg.QUIET_NS
        if gyro != 3:
            self._gyro_on_ns = None
        elif self._gyro_on_ns is None:
            self._gyro_on_ns = t_ns
        if accel < 2:
            self._accel_on_ns = None
        elif self._accel_on_ns is None:
            self._accel_on_ns = t_ns

    def _refresh(self, t_ns: int) -> None:
        """Take over the last latch before ``t_ns`` into the data registers."""
        bank = self._banks[0]
        if t_ns < self.zero_until_ns:
            bank[reg.DATA_FIRST : reg.DATA_LAST + 1] = bytes(14)
            self._latched = -1
            return
        gyro = self._gyro_on_ns is not None and t_ns >= self._gyro_on_ns + reg.GYRO_START_NS
        accel = self._accel_on_ns is not None and t_ns >= self._accel_on_ns + reg.ACCEL_START_NS
        if not (gyro or accel) or t_ns < self.freeze_until_ns:
            return
        path = self.path
        self.sensing.configure(
            path.gyro_hz, path.accel_hz, path.data_hz, orders=path.orders,
            delay_s=path.delay_s,
        )  # fmt: skip
        index = self.sensing.latch_index(t_ns)
        if index == self._latched:
            return
        self._latched = index
        latch = self.sensing.latch(index)
        data_registers(self._banks, latch, path, gyro=gyro, accel=accel)
