"""The sequence that sets an ICM-42688-P and proves that it took."""

from collections import Counter
from collections.abc import Iterator

from drivers.clock import Clock
from drivers.errors import BusError, DeviceNotFoundError, FrameFormatError
from drivers.icm42688 import registers as reg
from drivers.icm42688.settings import Settings
from drivers.icm42688.spi_port import SpiRegisterPort
from drivers.register_port import PatientRegisters, RegisterPort


class BringUp:
    """Takes one chip from whatever state it is in to the wanted one.

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
        counters: Counter[str],
    ) -> None:
        self._port = port
        self._registers = PatientRegisters(port, name, counters)
        self._clock = clock
        self._name = name
        self._counters = counters
        self._is_spi = isinstance(port, SpiRegisterPort)
        self._wanted = settings.configuration(is_spi=self._is_spi)

    def steps(self) -> Iterator[int]:
        """Bring the chip up; yields the steady times, ns, at which to go on.

        It always begins with a reset, which takes 2 ms and clears what another program may have
        left: offsets, filters, a FIFO. The sensors are then off, as they have to be while
        anything but range, rate and power is written (Sec. 12.9).

        Raises
        ------
        DeviceNotFoundError
            If nothing or another chip answers, the reset has no effect, a setting does not take,
            or the gyro does not start.
        BusError
            If the bus fails more often than it is retried.
        """
        yield from self._identify()
        self._port.write_blind(reg.DEVICE_CONFIG, bytes((reg.SOFT_RESET,)))
        yield self._clock.now_ns() + reg.RESET_NS
        yield from self._identify()
        self._check_reset()
        if not self._is_spi:
            self._registers.set(reg.DRIVE_CONFIG, reg.I2C_SLEW_RATE, "DRIVE_CONFIG")
            self._switch_i3c_off()
        for register, value in self._wanted.items():
            if register != reg.PWR_MGMT0:
                self._registers.set(register, value, NAMES[register])
        self._registers.write(reg.PWR_MGMT0, bytes((self._wanted[reg.PWR_MGMT0],)))
        yield self._clock.now_ns() + reg.GYRO_START_NS
        wrong = self._wrong_setting() and self._wrong_setting()  # one read may have had a false bit
        if wrong is not None:
            msg = f"{self._name}: {wrong}"
            raise DeviceNotFoundError(msg)
        yield from self._wait_for_data()

    def _identify(self) -> Iterator[int]:
        """Wait for the chip id; a chip that just got its supply does not answer at once."""
        give_up_ns = self._clock.now_ns() + reg.START_TIMEOUT_NS
        while True:
            found: int | None = None
            cause: Exception | None = None
            try:
                found = self._chip_id()
            except (BusError, FrameFormatError) as error:
                cause = error
            if found == reg.CHIP_ID_VALUE:
                return
            if self._clock.now_ns() >= give_up_ns:
                msg = f"{self._name}: {_what_answers(found, cause, is_spi=self._is_spi)}"
                raise DeviceNotFoundError(msg) from cause
            self._counters["identify_retries"] += 1
            yield self._clock.now_ns() + 10_000_000

    def _chip_id(self) -> int:
        """Return the chip id; only what looks like another bank of this chip is written to."""
        found, bank = self._port.read(reg.CHIP_ID, 2)
        if found != reg.CHIP_ID_VALUE and 1 <= bank <= reg.HIGHEST_BANK:
            self._port.write(reg.BANK_SEL, b"\x00")
            found = self._port.read(reg.CHIP_ID, 1)[0]
        return found

    def _check_reset(self) -> None:
        status = self._registers.read(reg.INT_STATUS, 1)[0]
        if not status & reg.RESET_DONE:
            msg = (
                f"{self._name}: INT_STATUS reads 0x{status:02X} after a reset, expected bit 4 set; "
                "the chip does not take what is written to it"
            )
            raise DeviceNotFoundError(msg)

    def _switch_i3c_off(self) -> None:
        """Keep traffic to others on this bus from being taken for I3C (Sec. 12.3)."""
        self._registers.write(reg.BANK_SEL, b"\x01")
        try:
            self._registers.set(reg.INTF_CONFIG6, reg.I3C_OFF, "INTF_CONFIG6")
        finally:
            self._registers.write(reg.BANK_SEL, b"\x00")

    def _wrong_setting(self) -> str | None:
        return wrong_setting(self._registers, self._wanted)

    def _wait_for_data(self) -> Iterator[int]:
        """Wait until the gyro gives valid data."""
        give_up_ns = self._clock.now_ns() + reg.DATA_TIMEOUT_NS
        invalid = reg.INVALID.to_bytes(2, "big", signed=True)
        while self._registers.read(reg.GYRO_DATA, 6) == 3 * invalid:
            if self._clock.now_ns() >= give_up_ns:
                waited_ms = (reg.GYRO_START_NS + reg.DATA_TIMEOUT_NS) // 1_000_000
                msg = (
                    f"{self._name}: no gyro data {waited_ms} ms after it was switched on; the "
                    "chip is defective or badly supplied"
                )
                raise DeviceNotFoundError(msg)
            yield self._clock.now_ns() + 10_000_000
        self._registers.read(reg.INT_STATUS, 1)


NAMES = {
    reg.INTF_CONFIG0: "INTF_CONFIG0",
    reg.INTF_CONFIG1: "INTF_CONFIG1",
    reg.PWR_MGMT0: "PWR_MGMT0",
    reg.GYRO_CONFIG0: "GYRO_CONFIG0",
    reg.ACCEL_CONFIG0: "ACCEL_CONFIG0",
    reg.GYRO_CONFIG1: "GYRO_CONFIG1",
    reg.GYRO_ACCEL_CONFIG0: "GYRO_ACCEL_CONFIG0",
    reg.ACCEL_CONFIG1: "ACCEL_CONFIG1",
}


def wrong_setting(registers: RegisterPort | PatientRegisters, wanted: dict[int, int]) -> str | None:
    """Return which register reads what it should not, or None.

    Parameters
    ----------
    registers : RegisterPort or PatientRegisters
        The chip, on bank 0.
    wanted : dict of int to int
        ``Settings.configuration``: consecutive registers.

    Raises
    ------
    BusError, FrameFormatError
        If they cannot be read.
    """
    first = min(wanted)
    block = registers.read(first, len(wanted))
    for register, value in wanted.items():
        found = block[register - first]
        if found != value:
            return f"{NAMES[register]} reads 0x{found:02X}, expected 0x{value:02X}"
    return None


def _what_answers(found: int | None, cause: Exception | None, *, is_spi: bool) -> str:
    expected = f"expected 0x{reg.CHIP_ID_VALUE:02X}"
    if found is None:
        return f"no answer, {expected}: {cause}"
    text = f"chip id 0x{found:02X}, {expected}"
    if is_spi and found in (0x00, 0xFF):
        return f"{text}; nothing drives SDO: check supply, wiring and chip select"
    return text
