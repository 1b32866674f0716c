"""The seams between the drivers and what they talk to: real hardware or the simulated wing."""

from collections.abc import Sequence
from typing import Protocol, TypeVar, runtime_checkable

from drivers.events import Event

T_co = TypeVar("T_co", covariant=True)


class I2cBus(Protocol):
    """The subset of ``smbus2.SMBus`` that the drivers use."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read ``length`` (at most 32) bytes from ``register``."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write at most 32 bytes from ``register`` on."""
        ...

    def close(self) -> None:
        """Release the bus."""
        ...


class SerialPort(Protocol):
    """The subset of ``serial.Serial`` that the drivers use."""

    timeout: float | None

    def read(self, size: int = 1) -> bytes:
        """Return up to ``size`` bytes; fewer when ``timeout`` passes first."""
        ...

    def write(self, data: bytes) -> int | None:
        """Write all of ``data``."""
        ...

    def reset_input_buffer(self) -> None:
        """Drop what was received and not read."""
        ...

    def close(self) -> None:
        """Release the port."""
        ...


class Source(Protocol[T_co]):
    """Where samples come from."""

    def read(self, timeout_s: float) -> T_co | None:
        """Return the next sample, or None if none came within ``timeout_s``.

        With ``timeout_s=0`` it returns what is due now.

        Raises
        ------
        DriverError
            If the device or its bus failed for good.
        """
        ...

    def close(self) -> None:
        """Release what the source holds; may be called twice."""
        ...


@runtime_checkable
class Reporting(Protocol):
    """A source that counts what it does and says what happens to it."""

    def health(self) -> dict[str, dict[str, int]]:
        """Return its counters by name of what counts: a pod, a bus, a camera."""
        ...

    def take_events(self) -> list[Event]:
        """Return what happened since the last call, oldest first."""
        ...
