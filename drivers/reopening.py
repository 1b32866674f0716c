"""I2C and SPI nodes and serial ports that come back: an adapter pulled out and put in again.

An open file of a node that vanished stays dead for good, so it is closed and the node is opened
again with the next transfer, until that works.
"""

import errno
from collections.abc import Callable, Sequence
from typing import Final, Generic, Protocol, TypeVar

from drivers.interfaces import I2cBus, SerialPort, SpiDevice

NODE_GONE: Final = frozenset(
    [errno.ENOTCONN, errno.ENODEV, errno.ESHUTDOWN, errno.EBADF, errno.ENOENT]
)


class _Closable(Protocol):
    def close(self) -> None: ...


T = TypeVar("T", bound=_Closable)
R = TypeVar("R")


class Reopening(Generic[T]):
    """A device that is opened again when it fails or vanishes.

    Parameters
    ----------
    opener : callable
        Opens the device; raises OSError.

    Attributes
    ----------
    reopened : int
        How often it came back.

    Raises
    ------
    OSError
        If it does not open at first.
    """

    def __init__(self, opener: Callable[[], T]) -> None:
        self._opener = opener
        self._device: T | None = opener()
        self.reopened = 0

    def _open(self) -> T:
        if self._device is None:
            self._device = self._opener()
            self.reopened += 1
        return self._device

    def close(self) -> None:
        """Release the device; it opens again when it is used."""
        device, self._device = self._device, None
        if device is not None:
            device.close()


class ReopeningI2cBus(Reopening[I2cBus]):
    """An ``I2cBus`` whose node may vanish and return; a NAK or a timeout leaves it open."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read ``length`` (at most 32) bytes from ``register``."""
        return self._transfer(lambda bus: bus.read_i2c_block_data(i2c_addr, register, length))

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write at most 32 bytes from ``register`` on."""
        self._transfer(lambda bus: bus.write_i2c_block_data(i2c_addr, register, data))

    def _transfer(self, do: Callable[[I2cBus], R]) -> R:
        try:
            return do(self._open())
        except OSError as error:
            if error.errno in NODE_GONE:
                self.close()
            raise


class ReopeningSpi(Reopening[SpiDevice]):
    """A ``SpiDevice`` whose node may vanish and return."""

    def xfer2(self, values: Sequence[int]) -> Sequence[int]:
        """Send bytes with the chip selected throughout; return what came meanwhile."""
        try:
            return self._open().xfer2(values)
        except OSError as error:
            if error.errno in NODE_GONE:
                self.close()
            raise


class ReopeningSerial(Reopening[SerialPort]):
    """A ``SerialPort`` whose line may hang up and return; any error of the system is a hang-up."""

    def __init__(self, opener: Callable[[], SerialPort]) -> None:
        super().__init__(opener)
        self._timeout: float | None = self._open().timeout

    @property
    def timeout(self) -> float | None:
        """Longest wait of a read, s."""
        return self._timeout

    @timeout.setter
    def timeout(self, value: float | None) -> None:
        self._timeout = value
        if self._device is not None:
            self._device.timeout = value

    def read(self, size: int = 1) -> bytes:
        """Return up to ``size`` bytes; fewer when ``timeout`` passes first."""
        return self._transfer(lambda line: line.read(size))

    def write(self, data: bytes) -> int | None:
        """Write all of ``data``."""
        return self._transfer(lambda line: line.write(data))

    def reset_input_buffer(self) -> None:
        """Drop what was received and not read."""
        self._transfer(lambda line: line.reset_input_buffer())

    def _transfer(self, do: Callable[[SerialPort], R]) -> R:
        was_gone = self._device is None
        try:
            line = self._open()
            if was_gone:
                line.timeout = self._timeout
            return do(line)
        except OSError:  # serial.SerialException is one
            self.close()
            raise
