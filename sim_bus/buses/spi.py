"""A simulated chip behind the methods of ``spidev.SpiDev``: one chip select of an SPI bus."""

import errno
import os
from collections.abc import Sequence
from typing import Protocol

from drivers.clock import Clock
from sim_bus.buses.faults import FaultPlan, flip_bit_7
from sim_bus.chip.sim_chip import SimChip


class SpiChip(SimChip, Protocol):
    """A chip that also speaks SPI."""

    def transfer(self, sent: bytes, t_ns: int) -> bytes:
        """Return what the chip sends while it receives ``sent``, selected at ``t_ns``."""
        ...


class SimSpiDevice:
    """One chip select of an SPI bus with a chip behind it.

    Parameters
    ----------
    chip : SpiChip
        The chip.
    clock : Clock
        The rig's clock. A transfer takes 8 / ``speed_hz`` per byte and the call of its time.
    target : str
        Name under which faults find the chip.
    faults : FaultPlan
        What goes wrong: ``io_error`` (EIO), ``spike`` (a false bit in what is read), ``spi_low``
        and ``spi_high`` (SDO broken off, held low or high).
    speed_hz : int
        Clock of the bus, Hz.
    """

    # What a call of ``xfer2`` costs on a small board beside its bytes.
    CALL_NS = 40_000

    def __init__(
        self,
        chip: SpiChip,
        clock: Clock,
        *,
        target: str,
        faults: FaultPlan | None = None,
        speed_hz: int = 1_000_000,
    ) -> None:
        self._chip, self._clock, self._target = chip, clock, target
        self._faults = FaultPlan() if faults is None else faults
        self._byte_ns = round(8e9 / speed_hz)
        self.is_open = True

    def xfer2(self, values: Sequence[int]) -> list[int]:
        """Send bytes with the chip selected throughout; return what came meanwhile."""
        if not self.is_open:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        now_ns = self._clock.now_ns()
        self._faults.apply_to_chip(self._chip, self._target, now_ns)
        if self._faults.strikes("io_error", self._target, now_ns):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        # The chip gives its data behind the address; the whole is slept in one piece.
        data = self._chip.transfer(bytes(values), now_ns + self._byte_ns)
        self._clock.sleep_until_ns(now_ns + self.CALL_NS + len(values) * self._byte_ns)
        return list(self._spoilt(data, now_ns))

    def _spoilt(self, data: bytes, now_ns: int) -> bytes:
        strikes = self._faults.strikes
        if strikes("spi_low", self._target, now_ns):
            return bytes(len(data))
        if strikes("spi_high", self._target, now_ns):
            return b"\xff" * len(data)
        if strikes("spike", self._target, now_ns):
            return data[:1] + flip_bit_7(data[1:], self._faults.rng)
        return data

    def close(self) -> None:
        """Release the device."""
        self.is_open = False
