"""Counts a controller's CAN error frames by class; reports each class once."""

from collections import Counter
from collections.abc import Callable
from typing import Final

from drivers.can.port import CanFrame
from drivers.events import Level

# Linux, include/uapi/linux/can/error.h; python-can's adapters give the same bits.
ERROR_NAMES: Final = (
    (0x001, "tx_timeout"),
    (0x002, "lost_arbitration"),
    (0x004, "controller"),
    (0x008, "protocol"),
    (0x010, "transceiver"),
    (0x020, "no_acknowledge"),
    (0x040, "bus_off"),
    (0x080, "bus_error"),
    (0x100, "restarted"),
)


class ErrorFrames:
    """Counts error frames as ``error_<class>``, and reports each class once.

    Going off the bus and coming back are reported each time. A frame without a class, which some
    adapters give, is ``error_unnamed``.

    Parameters
    ----------
    counters : Counter of str
        The port's.
    say : callable
        Takes the level and the words of an event.
    """

    def __init__(self, counters: Counter[str], say: Callable[[Level, str], None]) -> None:
        self._counters, self._say = counters, say

    def take(self, frame: CanFrame) -> None:
        """Count one error frame."""
        names = [name for bit, name in ERROR_NAMES if frame.arbitration_id & bit]
        for name in names or ["unnamed"]:
            if not self._counters[f"error_{name}"] or name in ("bus_off", "restarted"):
                level: Level = "error" if name == "bus_off" else "warning"
                text = f"error frame 0x{frame.arbitration_id:X}#{frame.data.hex()}"
                self._say(level, f"{name.replace('_', ' ')}: {text}")
            self._counters[f"error_{name}"] += 1
