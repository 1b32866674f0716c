"""The sequence that sets a BNO055 and proves that it took."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.bno055 import registers as reg
from drivers.bno055.calibration import CalibrationStore
from drivers.bno055.registers import Mode
from drivers.bno055.settings import Settings
from drivers.clock import Clock
from drivers.errors import BusError, DeviceNotFoundError, FrameFormatError
from drivers.register_port import PatientRegisters, RegisterPort


@dataclass(frozen=True, slots=True, eq=False)
class ChipState:
    """What the bring-up found.

    Attributes
    ----------
    uid : bytes
        Unique id of the chip, 16 bytes.
    gyro_offset_rad_s, accel_offset_m_s2 : ndarray, shape (3,)
        Offsets that the host has to subtract; zero in fusion modes, where the chip does it.
    calibrated : bool
        Whether a stored calibration was restored.
    """

    uid: bytes
    gyro_offset_rad_s: NDArray[np.float64]
    accel_offset_m_s2: NDArray[np.float64]
    calibrated: bool = False


class BringUp:
    """Takes one chip from whatever state it is in to the wanted one.

    ``steps`` is a generator that yields the instants it has to wait for, so that one bus can go
    on reading its other chips meanwhile; ``state`` holds the result once it is exhausted.

    Parameters
    ----------
    port : RegisterPort
        The chip's registers.
    clock : Clock
        The steady clock; only read here.
    name : str
        What messages call the chip, e.g. ``pod 1``.
    settings : Settings
        The wanted state.
    calibrations : CalibrationStore or None
        Where offsets are restored from.
    counters : Counter
        Where retries are counted.
    """

    def __init__(
        self,
        port: RegisterPort,
        clock: Clock,
        *,
        name: str,
        settings: Settings,
        calibrations: CalibrationStore | None,
        counters: Counter[str],
    ) -> None:
        self._port = port
        self._registers = PatientRegisters(port, name, counters)
        self._clock = clock
        self._name = name
        self._settings = settings
        self._calibrations = calibrations
        self._counters = counters
        self.state: ChipState | None = None

    def steps(self, *, reset: bool) -> Iterator[int]:
        """Bring the chip up; yields the steady times, ns, at which to go on.

        Raises
        ------
        DeviceNotFoundError
            If nothing or another chip answers, the self-test failed, or a setting does not take.
        BusError
            If the bus fails more often than it is retried.
        """
        yield from self._identify()
        if reset:
            self._port.write_blind(reg.SYS_TRIGGER, bytes((reg.RESET_SYSTEM,)))
            yield self._clock.now_ns() + reg.RESET_NS
            yield from self._identify()
        self._registers.write(reg.PAGE_ID, b"\x00")
        yield from self._switch(Mode.CONFIG)
        self._check_self_test()
        self._registers.set(reg.PWR_MODE, reg.POWER_NORMAL, "PWR_MODE")
        self._registers.set(reg.UNIT_SEL, reg.UNITS, "UNIT_SEL")
        uid = self._set_page_1()
        calibrated = self._restore(uid)
        if self._settings.external_crystal:
            # After the calibration: restoring it would be lost on the switch of the clock.
            yield from self._choose_crystal()
        gyro, accel = self._offsets()
        yield from self._switch(self._settings.mode)
        self.state = ChipState(uid, gyro, accel, calibrated)

    def _identify(self) -> Iterator[int]:
        """Wait for the chip id; a chip in reset does not answer for 650 ms."""
        give_up_ns = self._clock.now_ns() + reg.START_TIMEOUT_NS
        while True:
            found: int | None = None
            cause: Exception | None = None
            try:
                found = self._port.read(reg.CHIP_ID, 1)[0]
                # A foreign device is not written to; only what looks like page 1 is turned back.
                if found != reg.CHIP_ID_VALUE and self._port.read(reg.PAGE_ID, 1) == b"\x01":
                    self._port.write(reg.PAGE_ID, b"\x00")
                    found = self._port.read(reg.CHIP_ID, 1)[0]
            except (BusError, FrameFormatError) as error:
                cause = error
            if found == reg.CHIP_ID_VALUE:
                return
            if self._clock.now_ns() >= give_up_ns:
                expected = f"expected 0x{reg.CHIP_ID_VALUE:02X}"
                what = (
                    f"no answer, {expected}: {cause}"
                    if found is None
                    else (f"chip id 0x{found:02X}, {expected}")
                )
                msg = f"{self._name}: {what}"
                raise DeviceNotFoundError(msg) from cause
            self._counters["identify_retries"] += 1
            yield self._clock.now_ns() + 50_000_000

    def _switch(self, mode: Mode) -> Iterator[int]:
        for _ in range(PatientRegisters.ATTEMPTS):
            self._registers.write(reg.OPR_MODE, bytes((mode,)))
            yield self._clock.now_ns() + reg.MODE_SWITCH_NS
            found = self._registers.read(reg.OPR_MODE, 1)[0] & 0x0F
            if found == mode:
                return
            self._counters["retries"] += 1
        msg = f"{self._name}: OPR_MODE reads 0x{found:02X}, expected 0x{mode:02X} ({mode.name})"
        raise DeviceNotFoundError(msg)

    def _check_self_test(self) -> None:
        result = self._registers.read(reg.ST_RESULT, 1)[0] & reg.SELF_TEST_PASSED
        if result != reg.SELF_TEST_PASSED:
            failed = [p for i, p in enumerate(reg.SELF_TEST_PARTS) if not result >> i & 1]
            msg = (
                f"{self._name}: self-test 0x{result:02X}, expected 0x{reg.SELF_TEST_PASSED:02X} "
                f"({', '.join(failed)} failed); the chip is defective or badly supplied"
            )
            raise DeviceNotFoundError(msg)

    def _set_page_1(self) -> bytes:
        self._registers.write(reg.PAGE_ID, b"\x01")
        try:
            uid = self._registers.read(reg.UNIQUE_ID, reg.UNIQUE_ID_LENGTH)
            if not self._settings.mode.is_fusion:
                wanted = reg.gyro_config(
                    self._settings.gyro_range_dps, self._settings.gyro_bandwidth_hz
                )
                self._registers.set(reg.GYR_CONFIG_0, wanted, "GYR_CONFIG_0")
                self._registers.set(reg.GYR_CONFIG_1, reg.GYRO_POWER_NORMAL, "GYR_CONFIG_1")
                if self._settings.mode.has_accel:
                    self._registers.set(reg.ACC_CONFIG, reg.ACC_16G_62HZ, "ACC_CONFIG")
        finally:
            self._registers.write(reg.PAGE_ID, b"\x00")
        return uid

    def _restore(self, uid: bytes) -> bool:
        stored = None if self._calibrations is None else self._calibrations.load(uid)
        if stored is None:
            return False
        self._registers.write(reg.CALIBRATION, stored)
        found = self._registers.read(reg.CALIBRATION, reg.CALIBRATION_LENGTH)
        if found != stored:
            msg = f"{self._name}: calibration reads {found.hex()}, expected {stored.hex()}"
            raise DeviceNotFoundError(msg)
        return True

    def _choose_crystal(self) -> Iterator[int]:
        for _ in range(PatientRegisters.ATTEMPTS):
            if not self._registers.read(reg.SYS_CLK_STATUS, 1)[0] & 1:
                break
            yield self._clock.now_ns() + reg.CRYSTAL_SWITCH_NS
        self._registers.write(reg.SYS_TRIGGER, bytes((reg.EXTERNAL_CRYSTAL,)))
        yield self._clock.now_ns() + reg.CRYSTAL_SWITCH_NS
        found = self._registers.read(reg.SYS_TRIGGER, 1)[0]
        if not found & reg.EXTERNAL_CRYSTAL:
            msg = (
                f"{self._name}: SYS_TRIGGER reads 0x{found:02X}, the external crystal was not "
                "taken; fit one or set external_crystal = false"
            )
            raise DeviceNotFoundError(msg)

    def _offsets(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self._settings.mode.is_fusion:
            return np.zeros(3), np.zeros(3)
        block = self._registers.read(reg.ACC_OFFSET, 18)
        offsets = np.frombuffer(block, dtype="<i2").astype(np.float64)
        return offsets[6:] * reg.GYRO_OFFSET_SCALE_RAD_S, offsets[:3] * reg.ACCEL_SCALE_M_S2
