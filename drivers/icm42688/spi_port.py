"""Registers over SPI: one byte of address, bit 7 set to read (DS-000347 rev. 1.5, Sec. 9.6)."""

import errno
from collections import Counter
from collections.abc import Sequence
from typing import Final

from drivers.errors import BusError, BusTimeoutError
from drivers.interfaces import SpiDevice

READ: Final = 0x80


class SpiRegisterPort:
    """A chip on its own chip select of an SPI bus.

    Nothing acknowledges on this bus: what a dead line reads, all ones or zeros, looks like data,
    and it is for the chip's driver to notice.

    Parameters
    ----------
    device : SpiDevice
        ``spidev.SpiDev`` or its simulation.
    """

    address_bytes = 1

    def __init__(self, device: SpiDevice) -> None:
        self._device = device
        self.counters: Counter[str] = Counter()
        self.taken_ns: int | None = None

    def read(self, register: int, length: int) -> bytes:
        """Return ``length`` bytes from ``register`` on, in one burst."""
        sent = [READ | register] + [0] * length
        received = self._transfer(sent, f"read of register 0x{register:02X} over SPI")
        return bytes(received[1:])

    def write(self, register: int, data: bytes) -> None:
        """Write ``data`` from ``register`` on, a byte a transfer: the chip takes no longer one."""
        for offset, value in enumerate(data):
            doing = f"write of register 0x{register + offset:02X} over SPI"
            self._transfer([register + offset, value], doing)

    def write_blind(self, register: int, data: bytes) -> None:
        """Write; nothing on this bus can fail to answer."""
        self.write(register, data)

    def settle(self) -> None:
        """Do nothing: the chip select ends every transfer."""

    def _transfer(self, sent: list[int], doing: str) -> Sequence[int]:
        try:
            received = self._device.xfer2(sent)
        except OSError as error:
            number = error.errno if error.errno is not None else errno.EIO
            is_late = number == errno.ETIMEDOUT
            self.counters["spi_timeout" if is_late else "spi_io"] += 1
            kind = BusTimeoutError if is_late else BusError
            msg = f"{doing}: {error.strerror or error} (errno {number})"
            raise kind(msg) from error
        if len(received) != len(sent):
            self.counters["spi_short"] += 1
            msg = f"{doing}: {len(received)} bytes, expected {len(sent)}"
            raise BusError(msg)
        return received
