"""What every simulated chip offers to the buses that reach it and to the faults that act on it."""

from typing import Protocol

from sim_bus.chip.sensing import Sensing


class ChipSilentError(Exception):
    """The chip does not answer; the bus turns it into what its driver would see."""


class SimChip(Protocol):
    """A chip at the level of its registers.

    Attributes
    ----------
    sensing : Sensing
        What it measures, before it becomes counts.
    freeze_until_ns, zero_until_ns : int
        Until when the data registers stand still, or read zero, ns.
    stretches_clock : bool
        Whether the chip makes an I2C transfer take longer than its bits.
    """

    sensing: Sensing
    stretches_clock: bool
    freeze_until_ns: int
    zero_until_ns: int

    def read(self, register: int, length: int, t_ns: int) -> bytes:
        """Return ``length`` bytes from ``register`` on, as read at ``t_ns``.

        Raises
        ------
        ChipSilentError
            While the chip is in reset or without power.
        """
        ...

    def write(self, register: int, data: bytes, t_ns: int) -> None:
        """Write ``data`` from ``register`` on at ``t_ns``; what cannot be written is ignored.

        Raises
        ------
        ChipSilentError
            While the chip is in reset or without power.
        """
        ...

    def brown_out(self, t_ns: int, silent_ns: int = ...) -> None:
        """Lose power for a moment: silent for ``silent_ns``, then its defaults."""
        ...

    def select_page(self, page: int) -> None:
        """Leave the page or bank register where a crashed program left it."""
        ...
