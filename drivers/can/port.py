"""One CAN bus as the drivers see it: frames with steady stamps; a reader that outlives faults."""

from collections import Counter
from dataclasses import dataclass
from typing import Protocol

from drivers.events import Event


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One classic frame.

    Attributes
    ----------
    t_ns : int
        Steady time of its reception (or, of an own frame, of its transmission), ns.
    arbitration_id : int
        Identifier; of an error frame the error class bits.
    data : bytes
        Payload.
    is_extended, is_remote, is_error, is_own : bool
        Kind of the frame; ``is_own`` marks the echo of what this port sent.
    """

    t_ns: int
    arbitration_id: int
    data: bytes
    is_extended: bool = False
    is_remote: bool = False
    is_error: bool = False
    is_own: bool = False


class CanPort(Protocol):
    """One CAN bus."""

    name: str
    counters: Counter[str]

    def recv(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame, None if none came in time or the bus is down just now."""
        ...

    def send(self, arbitration_id: int, data: bytes) -> int | None:
        """Send a frame; returns its transmit stamp, None if it was not sent (and counted).

        Where the stamp comes later as the echo of the own frame, ``echoes`` is true and the
        returned stamp is that of the call.
        """
        ...

    @property
    def echoes(self) -> bool:
        """Whether own frames come back through ``recv`` with their transmit stamp."""
        ...

    def take_events(self) -> list[Event]:
        """Return what happened to the bus since the last call."""
        ...

    def close(self) -> None:
        """Release the bus; may be called twice."""
        ...
