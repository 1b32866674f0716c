"""The seams between the drivers and what they talk to: real hardware or the simulated wing."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from drivers.events import Event
from drivers.samples import ImuSample

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


class SpiDevice(Protocol):
    """The subset of ``spidev.SpiDev`` that the drivers use: one chip select of an SPI bus."""

    def xfer2(self, values: Sequence[int]) -> Sequence[int]:
        """Send bytes with the chip selected throughout; return what came meanwhile."""
        ...

    def close(self) -> None:
        """Release the device."""
        ...


@dataclass(frozen=True, slots=True)
class ChipFault:
    """Why a chip has to be brought up again.

    Attributes
    ----------
    what : str
        What was found and what was expected.
    needs_reset : bool
        Whether configuring it again is not enough.
    """

    what: str
    needs_reset: bool = False


class ImuChip(Protocol):
    """One inertial sensor as ``PolledImus`` reads it.

    No call waits longer than its own transfers: what takes time is a generator of instants, and
    the owner of the bus decides how to spend them.
    """

    @property
    def name(self) -> str:
        """What messages and counters call the chip: ``pod 1``."""
        ...

    @property
    def uid(self) -> bytes:
        """What no other chip answers; empty if the chip has no such number or is not up."""
        ...

    @property
    def delay_s(self) -> float:
        """Mean age of a rate when it is read, s: the delay of the filter and of the register."""
        ...

    @property
    def delay_spread_s(self) -> float:
        """Half of the interval, s, over which that age is spread evenly."""
        ...

    @property
    def counters(self) -> dict[str, int]:
        """What happened how often, on the chip and on the way to it, by name."""
        ...

    def bring_up(self, *, reset: bool = False) -> Iterator[int]:
        """Identify, set and verify; yields the steady times, ns, at which to go on.

        Raises
        ------
        DriverError
            If the chip is not there, is another one, or does not take its settings.
        """
        ...

    def read(self, seq: int) -> ImuSample | None:
        """Return a sample numbered ``seq``; None if what came was invalid or late (and counted).

        Raises
        ------
        BusError, FrameFormatError
            If the transfer and its repetition failed.
        """
        ...

    @property
    def is_doubtful(self) -> bool:
        """Whether the last read calls for ``fault`` now, before its time."""
        ...

    def fault(self) -> ChipFault | None:
        """Return why the chip has to be brought up again, or None; asked about once a second.

        Raises
        ------
        BusError, FrameFormatError
            If it cannot be asked.
        """
        ...


@runtime_checkable
class StoresCalibration(Protocol):
    """A chip that learns a calibration which outlives its supply."""

    def may_save_calibration(self) -> bool:
        """Return whether there is a place for it and the chip has learnt all of it.

        Raises
        ------
        BusError, FrameFormatError
            If it cannot be asked.
        """
        ...

    def save_calibration(self) -> Iterator[int]:
        """Store it; yields instants, ns, to wait for.

        Raises
        ------
        DriverError
            If the bus fails or the calibration cannot be written.
        """
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
    """A source that counts what it does and reports what happens to it."""

    def health(self) -> dict[str, dict[str, int]]:
        """Return its counters by name of what counts: a pod, a bus, a camera."""
        ...

    def take_events(self) -> list[Event]:
        """Return what happened since the last call, oldest first."""
        ...


class ImuSource(Source[ImuSample], Reporting, Protocol):
    """The IMUs of one bus: brought up before the first sample, each with its chip id."""

    def open(self) -> None:
        """Bring every IMU up and wait for it.

        Raises
        ------
        DriverError
            If one is missing, is another one, or does not take its settings.
        """
        ...

    def chip_ids(self) -> dict[str, bytes]:
        """Return the unique id of each chip by what messages call the IMU; empty if unknown."""
        ...
