"""Registers of one chip: how a bus offers them, and access that repeats what failed."""

from collections import Counter
from typing import Protocol

from drivers.errors import BusError, DeviceNotFoundError, FrameFormatError


class RegisterPort(Protocol):
    """Registers of one chip, on the page or bank that is selected.

    Attributes
    ----------
    counters : Counter of str
        What went wrong how often.
    taken_ns : int or None
        When the chip took the data of the last read, ns, where the port knows.
    address_bytes : int
        How many bytes go before the data of a read.
    """

    counters: Counter[str]
    taken_ns: int | None
    address_bytes: int

    def read(self, register: int, length: int) -> bytes:
        """Return ``length`` bytes from ``register`` on, in one burst.

        Raises
        ------
        BusError
            If the bus fails or the chip does not answer.
        """
        ...

    def write(self, register: int, data: bytes) -> None:
        """Write ``data`` from ``register`` on.

        Raises
        ------
        BusError
            If the bus fails or the chip does not answer.
        """
        ...

    def write_blind(self, register: int, data: bytes) -> None:
        """Write where the answer may fail to come: a reset of the chip."""
        ...

    def settle(self) -> None:
        """Bring the link to a known state after an error."""
        ...


class PatientRegisters:
    """The registers of a chip that is being set: failed transfers are repeated and counted.

    Parameters
    ----------
    port : RegisterPort
        The chip's registers.
    name : str
        What messages call the chip, e.g. ``pod 1``.
    counters : Counter
        Where retries are counted.
    """

    ATTEMPTS = 3

    def __init__(self, port: RegisterPort, name: str, counters: Counter[str]) -> None:
        self._port = port
        self._name = name
        self._counters = counters

    def read(self, register: int, length: int) -> bytes:
        """Return ``length`` bytes from ``register`` on.

        Raises
        ------
        BusError, FrameFormatError
            If every attempt fails.
        """
        for _ in range(self.ATTEMPTS - 1):
            try:
                return self._port.read(register, length)
            except (BusError, FrameFormatError):
                self._counters["retries"] += 1
        return self._port.read(register, length)

    def write(self, register: int, data: bytes) -> None:
        """Write ``data`` from ``register`` on; see ``read`` for errors."""
        for _ in range(self.ATTEMPTS - 1):
            try:
                self._port.write(register, data)
            except (BusError, FrameFormatError):
                self._counters["retries"] += 1
            else:
                return
        self._port.write(register, data)

    def set(self, register: int, value: int, what: str) -> None:
        """Write one register and read it back.

        Raises
        ------
        DeviceNotFoundError
            If it reads something else in every attempt; the message calls it ``what``.
        BusError, FrameFormatError
            As ``read``.
        """
        for _ in range(self.ATTEMPTS):
            self.write(register, bytes((value,)))
            found = self.read(register, 1)[0]
            if found == value:
                return
            self._counters["retries"] += 1
        msg = f"{self._name}: {what} reads 0x{found:02X}, expected 0x{value:02X}"
        raise DeviceNotFoundError(msg)
