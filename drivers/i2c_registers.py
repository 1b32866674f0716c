"""Registers of a chip over I2C, behind a multiplexer if need be; a ``RegisterPort``."""

import errno
from collections import Counter

from drivers.errors import BusError, BusTimeoutError
from drivers.interfaces import I2cBus
from drivers.tca9548a import MuxChannel

_CAUSES = {
    errno.EIO: "i2c_io",
    errno.EAGAIN: "i2c_arbitration_lost",
    errno.ETIMEDOUT: "i2c_timeout",
    errno.EREMOTEIO: "i2c_nak",
    errno.ENXIO: "i2c_nak",  # what some adapters say for EREMOTEIO
}


def _bus_error(error: OSError, doing: str, counters: Counter[str]) -> BusError:
    number = error.errno if error.errno is not None else errno.ETIMEDOUT
    counters[_CAUSES.get(number, "i2c_other")] += 1
    kind = BusTimeoutError if number == errno.ETIMEDOUT else BusError
    return kind(f"{doing}: {error.strerror or error} (errno {number})")


class I2cRegisterPort:
    """A chip on an I2C bus.

    Parameters
    ----------
    bus : I2cBus
        ``smbus2.SMBus`` or its simulation.
    address : int
        Seven-bit address.
    behind : MuxChannel or None
        The channel of a multiplexer that leads to the chip.
    """

    # Address, register, address again.
    address_bytes = 3

    def __init__(self, bus: I2cBus, address: int, *, behind: MuxChannel | None = None) -> None:
        self._bus = bus
        self._address = address
        self._behind = behind
        self.counters: Counter[str] = Counter()
        self.taken_ns: int | None = None

    def read(self, register: int, length: int) -> bytes:
        """Return ``length`` (at most 32) bytes from ``register`` on."""
        try:
            if self._behind is not None:
                self._behind.select()
            data = bytes(self._bus.read_i2c_block_data(self._address, register, length))
        except OSError as error:
            self.settle()
            doing = f"read of register 0x{register:02X} at 0x{self._address:02X}"
            raise _bus_error(error, doing, self.counters) from error
        if len(data) != length:
            self.counters["i2c_short"] += 1
            msg = (
                f"read of register 0x{register:02X} at 0x{self._address:02X}: {len(data)} bytes, "
                f"expected {length}"
            )
            raise BusError(msg)
        return data

    def write(self, register: int, data: bytes) -> None:
        """Write at most 32 bytes from ``register`` on."""
        try:
            if self._behind is not None:
                self._behind.select()
            self._bus.write_i2c_block_data(self._address, register, list(data))
        except OSError as error:
            self.settle()
            doing = f"write of register 0x{register:02X} at 0x{self._address:02X}"
            raise _bus_error(error, doing, self.counters) from error

    def write_blind(self, register: int, data: bytes) -> None:
        """Write and accept that the chip does not acknowledge."""
        try:
            self.write(register, data)
        except BusError:
            self.counters["i2c_blind_write"] += 1

    def settle(self) -> None:
        """Set the multiplexers of the bus again before the next transfer."""
        if self._behind is not None:
            self._behind.muxes.forget()
