"""The TCA9548A multiplexers of one I2C bus: one channel of all of them is on at a time.

Two chips of one address that are on together answer together, and what is read is the AND of
both. So it is not enough that each multiplexer keeps to one channel.
"""

import errno
from collections.abc import Iterable
from dataclasses import dataclass

from drivers.interfaces import I2cBus

NOBODY_ANSWERS = (errno.EREMOTEIO, errno.ENXIO)
NO_CHANNEL = 0x00


class Muxes:
    """All multiplexers of a bus; remembers which channel is on.

    Parameters
    ----------
    bus : I2cBus
        The bus they sit on.
    addresses : iterable of int
        Where each answers, 0x70 to 0x77.
    """

    def __init__(self, bus: I2cBus, addresses: Iterable[int]) -> None:
        self._bus = bus
        self._addresses = tuple(sorted(set(addresses)))
        self._on: tuple[int, int] | None = None
        self._closed: set[int] = set()

    def channel(self, address: int, channel: int) -> "MuxChannel":
        """Return one channel of one of the multiplexers."""
        return MuxChannel(self, address, channel)

    def select(self, address: int, channel: int) -> None:
        """Connect one channel of one multiplexer and no other of any.

        A multiplexer that is not there lets nothing through; it is asked again before every
        transfer, since a single silence may have been a disturbance.

        Raises
        ------
        OSError
            As the bus raises it.
        """
        self._close_others(address)
        if self._on == (address, channel):
            return
        self._on = None
        self._closed.discard(address)
        self._write(address, 1 << channel)
        self._on = (address, channel)

    def forget(self) -> None:
        """Set all of them again before the next transfer."""
        self._on = None
        self._closed.clear()

    def _close_others(self, address: int) -> None:
        for other in self._addresses:
            if other == address or other in self._closed:
                continue
            try:
                self._write(other, NO_CHANNEL)
            except OSError as error:
                if error.errno not in NOBODY_ANSWERS:
                    raise
            else:
                self._closed.add(other)

    def _write(self, address: int, mask: int) -> None:
        # The chip has one register and keeps the last byte of a write; sending it twice stays
        # within the calls of ``I2cBus``.
        self._bus.write_i2c_block_data(address, mask, [mask])


@dataclass(frozen=True, slots=True)
class MuxChannel:
    """One channel of one multiplexer: the way to a chip."""

    muxes: Muxes
    address: int
    number: int

    def select(self) -> None:
        """Connect this channel and no other of the bus.

        Raises
        ------
        OSError
            As the bus raises it.
        """
        self.muxes.select(self.address, self.number)
