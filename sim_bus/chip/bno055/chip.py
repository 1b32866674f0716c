"""The simulated BNO055: one register-true chip behind I2C, UART, CUSE, Unicorn and the pods.

Two register pages, modes with their timing, reset with 650 ms of silence, configuration that a
fusion mode overrides, data latched by the chip's own clock. What the registers leave out: the
interrupt engine, the soft-iron matrix and the magnetometer's settings are stored, not acted on.
"""

import numpy as np

from sim_bus.chip.bno055 import registers as reg
from sim_bus.chip.bno055.counts import data_registers
from sim_bus.chip.bno055.registers import Mode
from sim_bus.chip.sensing import ImuErrors, ImuGrade, Latch, Motion, Sensing
from sim_bus.chip.sim_chip import ChipSilentError

STILL_DPS, STILL_LATCHES = 3.0, 100


class SimBno055:
    """A BNO055 at the level of its registers.

    Parameters
    ----------
    motion : Motion
        What moves the chip.
    rng : numpy.random.Generator
        Its errors, its noise and its unique id.
    grade : ImuGrade
        How good a chip it is.
    power_on_ns : int
        When it was switched on, ns; it answers 650 ms later unless ``is_booted``.
    is_booted : bool
        Whether the power-up is over at ``power_on_ns``.
    """

    stretches_clock = True

    def __init__(
        self,
        motion: Motion,
        rng: np.random.Generator,
        *,
        grade: ImuGrade | None = None,
        power_on_ns: int = 0,
        is_booted: bool = True,
    ) -> None:
        self.errors = ImuErrors.draw(ImuGrade() if grade is None else grade, rng)
        self.unique_id = bytes(rng.integers(0, 256, 16, dtype=np.uint8))
        self.sensing = Sensing(motion, self.errors, rng, power_on_ns)
        self._motion = motion
        self._pages = (bytearray(256), bytearray(256))
        self.freeze_until_ns = self.zero_until_ns = power_on_ns
        self._silent_until_ns = power_on_ns if is_booted else power_on_ns + reg.RESET_NS
        self._self_test_until_ns = 0
        self._mode, self._pending_mode, self._switch_at_ns = Mode.CONFIG, Mode.CONFIG, 0
        self._page = 0
        self._held: tuple[int, int] = (-1, -1)
        self._still, self._still_sum = 0, np.zeros(3)
        self._load_defaults()

    def _load_defaults(self) -> None:
        for page, values in zip(self._pages, (reg.PAGE_0_RESET, reg.PAGE_1_RESET), strict=True):
            page[:] = bytes(256)
            for register, value in values.items():
                page[register] = value
        self._pages[1][reg.UNIQUE_ID : reg.UNIQUE_ID + 16] = self.unique_id
        self._page, self._held = 0, (-1, -1)
        self._mode = self._pending_mode = Mode.CONFIG
        self._switch_at_ns = 0

    @property
    def mode(self) -> Mode:
        """The operation mode in force."""
        return self._mode

    @property
    def gyro_rad_s_per_lsb(self) -> float:
        """What one count of the gyro registers means now, rad/s."""
        if not self._mode.is_fusion:
            return float(np.radians(self._gyro_range_dps() / 32768))
        if self._pages[0][reg.UNIT_SEL] & 0x02:
            return 1 / reg.FUSION_LSB_PER_RAD_S
        return float(np.radians(1 / reg.FUSION_LSB_PER_DPS))

    def _gyro_range_dps(self) -> float:
        return reg.GYRO_RANGE_DPS[min(self._pages[1][reg.GYR_CONFIG_0] & 0x07, 4)]

    # What the buses call.

    def read(self, register: int, length: int, t_ns: int) -> bytes:
        """Return ``length`` bytes from ``register`` on, as read at ``t_ns``.

        Raises
        ------
        ChipSilentError
            While the chip is in reset or without power.
        """
        self._settle(t_ns)
        if self._page == 0 and register <= reg.CALIB_STAT and register + length > reg.DATA_FIRST:
            self._refresh(t_ns)
        page = self._pages[self._page]
        if self._page == 0:
            page[reg.SYS_STATUS] = self._system_status(t_ns)
            page[reg.ST_RESULT] = 0x00 if t_ns < self._self_test_until_ns else 0x0F
        page[reg.PAGE_ID] = self._page
        return bytes(page[(register + i) & 0xFF] for i in range(length))

    def write(self, register: int, data: bytes, t_ns: int) -> None:
        """Write ``data`` from ``register`` on at ``t_ns``; what cannot be written is ignored.

        Raises
        ------
        ChipSilentError
            While the chip is in reset or without power.
        """
        self._settle(t_ns)
        for offset, value in enumerate(data):
            self._write_byte(register + offset, value, t_ns)

    def is_writable(self, register: int) -> bool:
        """Return whether a write to ``register`` would be accepted now."""
        writable = reg.PAGE_1_WRITABLE if self._page else reg.PAGE_0_WRITABLE
        is_free = self._mode is Mode.CONFIG or register in reg.ALWAYS_WRITABLE
        return register in writable and is_free

    def _write_byte(self, register: int, value: int, t_ns: int) -> None:
        if not self.is_writable(register):
            return
        if register == reg.PAGE_ID:
            self._page = value & 0x01
        elif self._page == 0 and register == reg.OPR_MODE:
            self._request_mode(value & 0x0F, t_ns)
        elif self._page == 0 and register == reg.SYS_TRIGGER:
            self._trigger(value, t_ns)
        else:
            self._pages[self._page][register] = value

    # Faults.

    def brown_out(self, t_ns: int, silent_ns: int = reg.RESET_NS) -> None:
        """Lose power for a moment: silent, then CONFIG mode with all data zero and no error."""
        self._load_defaults()
        self._silent_until_ns = t_ns + silent_ns

    def select_page(self, page: int) -> None:
        """Leave the page register where a crashed program left it."""
        self._page = page & 0x01

    # Inside.

    def _settle(self, t_ns: int) -> None:
        """Bring modes up to ``t_ns``; a silent chip says so."""
        if t_ns < self._silent_until_ns:
            msg = f"chip is in reset for {(self._silent_until_ns - t_ns) * 1e-6:.0f} ms more"
            raise ChipSilentError(msg)
        if self._pending_mode is not self._mode and t_ns >= self._switch_at_ns:
            self._enter(self._pending_mode)

    def _request_mode(self, value: int, t_ns: int) -> None:
        if value > Mode.NDOF:
            return
        self._pending_mode = Mode(value)
        to_config = self._pending_mode is Mode.CONFIG
        self._switch_at_ns = t_ns + (reg.TO_CONFIG_NS if to_config else reg.FROM_CONFIG_NS)

    def _enter(self, mode: Mode) -> None:
        self._mode, self._held = mode, (-1, -1)
        self._still, self._still_sum = 0, np.zeros(3)
        self._pages[0][reg.OPR_MODE] = mode
        self._pages[0][reg.CALIB_STAT] = 0
        self._pages[0][reg.DATA_FIRST : reg.DATA_LAST + 1] = bytes(
            reg.DATA_LAST + 1 - reg.DATA_FIRST
        )
        if mode.is_fusion:  # Table 3-14: fusion takes the sensors over
            self._pages[1][reg.ACC_CONFIG] = 0x0D
            self._pages[1][reg.GYR_CONFIG_0], self._pages[1][reg.GYR_CONFIG_1] = 0x38, 0x00
        gyro_code = self._pages[1][reg.GYR_CONFIG_0] >> 3 & 0x07
        acc_code = self._pages[1][reg.ACC_CONFIG] >> 2 & 0x07
        data_hz = reg.FUSION_DATA_HZ if mode.is_fusion else reg.GYRO_DATA_HZ[gyro_code]
        self.sensing.configure(
            reg.GYRO_BANDWIDTH_HZ[gyro_code], reg.ACC_BANDWIDTH_HZ[acc_code], data_hz
        )

    def _trigger(self, value: int, t_ns: int) -> None:
        if value & 0x20:
            self.brown_out(t_ns)
            return
        if value & 0x01 and self._mode is Mode.CONFIG:
            self._self_test_until_ns = t_ns + reg.SELF_TEST_NS
        self._pages[0][reg.SYS_TRIGGER] = value & 0x80

    def _system_status(self, t_ns: int) -> int:
        if t_ns < self._self_test_until_ns:
            return 0x04
        if self._mode is Mode.CONFIG:
            return 0x00
        return 0x05 if self._mode.is_fusion else 0x06

    def _gyro_runs(self) -> bool:
        is_normal = self._pages[1][reg.GYR_CONFIG_1] & 0x07 in {0, 1}
        return self._mode.has_gyro and is_normal

    def _refresh(self, t_ns: int) -> None:
        """Take over the last latch before ``t_ns`` into the data registers."""
        page = self._pages[0]
        if t_ns < self.zero_until_ns:
            page[reg.DATA_FIRST : reg.DATA_LAST + 1] = bytes(reg.DATA_LAST + 1 - reg.DATA_FIRST)
            self._held = (-1, -1)
            return
        if self._mode is Mode.CONFIG or t_ns < self.freeze_until_ns:
            return
        if page[reg.PWR_MODE] & 0x03 == 2:
            return
        index = self.sensing.latch_index(t_ns)
        if self._held == (index, self._mode):
            return
        latch = self.sensing.latch(index)
        self._held = (index, self._mode)
        if self._mode.is_fusion:
            self._learn_offset(latch)
        page[reg.DATA_FIRST : reg.TEMP + 1] = data_registers(
            latch,
            mode=self._mode,
            registers=page,
            gyro_runs=self._gyro_runs(),
            gyro_range_rad_s=np.radians(self._gyro_range_dps()),
            gyro_rad_s_per_lsb=self.gyro_rad_s_per_lsb,
            acc_range_g=reg.ACC_RANGE_G[self._pages[1][reg.ACC_CONFIG] & 0x03],
            attitude=self._motion.attitude(latch.t_ns) if self._mode.is_fusion else None,
        )

    def _learn_offset(self, latch: Latch) -> None:
        """Do as the fusion firmware does: what stands still for a second is offset.

        A wing that moves slowly is therefore taken for a biased gyro.
        """
        page = self._pages[0]
        if not self._mode.has_gyro or np.abs(latch.rate_rad_s).max() > np.radians(STILL_DPS):
            self._still, self._still_sum = 0, np.zeros(3)
            return
        self._still, self._still_sum = self._still + 1, self._still_sum + latch.rate_rad_s
        if self._still >= STILL_LATCHES:
            mean_lsb = np.degrees(self._still_sum / self._still) * reg.FUSION_LSB_PER_DPS
            page[reg.GYR_OFFSET : reg.GYR_OFFSET + 6] = np.rint(mean_lsb).astype("<i2").tobytes()
            page[reg.CALIB_STAT] |= 0xF0
            self._still, self._still_sum = 0, np.zeros(3)
