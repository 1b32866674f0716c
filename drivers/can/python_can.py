"""CAN as the drivers use it: frames with steady stamps, errors counted, never a dead reader.

``PythonCanPort`` makes such a port of any python-can bus. SocketCAN has its own (``socketcan``),
because python-can cannot count what the kernel dropped. ``open_can`` chooses.
"""

import contextlib
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import can

from drivers.can.error_frames import ErrorFrames
from drivers.can.port import CanFrame, CanPort
from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from drivers.events import Event, EventList, Level

REOPEN_NS: Final = 1_000_000_000


class PythonCanPort:
    """Any python-can bus as a ``CanPort``.

    Parameters
    ----------
    bus : can.BusABC
        The bus; it is shut down on close.
    clock : Clock
        Stamps frames as they are taken from the bus.
    name : str
        What messages call it.
    reopen : callable, optional
        Opens the bus again after it has failed for a second: an adapter was unplugged.
    identifiers : tuple of (identifier, mask)
        Standard frames to let through; empty = all. Error frames always pass.

    Notes
    -----
    The filter is here, because python-can's would drop error frames by their class bits.

    python-can's slcan reader raises ValueError or IndexError on a malformed line, gives a frame
    shorter than its DLC for a line that lost its end, and fails on every later line once a byte
    is not ASCII, until it is flushed; all are counted and mended.
    """

    echoes = False

    def __init__(
        self,
        bus: can.BusABC,
        clock: Clock,
        *,
        name: str = "",
        reopen: Callable[[], can.BusABC] | None = None,
        identifiers: tuple[tuple[int, int], ...] = (),
    ) -> None:
        self.name = name or f"can {bus.channel_info}"
        self.counters: Counter[str] = Counter()
        self._bus: can.BusABC | None = bus
        self._clock = clock
        self._events = EventList()
        self._error_frames = ErrorFrames(self.counters, self._say)
        self._identifiers = identifiers
        self._is_failing = self._is_closed = False
        self._failing_since_ns = 0
        self._reopen = reopen

    def recv(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame, None if none came in time or the bus failed."""
        if self._is_closed or not self._is_usable(timeout_s):
            return None
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while (frame := self._next(timeout_s)) is not None:
            if self._passes(frame):
                return frame
            timeout_s = (deadline_ns - self._clock.now_ns()) * 1e-9
            if timeout_s <= 0:
                break
        return None

    def _next(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame of any identifier."""
        assert self._bus is not None
        try:
            message = self._bus.recv(timeout_s)
            if message is None:
                return None
            _check_length(message)
        except (ValueError, IndexError) as error:  # a malformed slcan line
            self.counters["malformed"] += 1
            self._flush()
            self._failing(f"malformed input: {error}", timeout_s=min(timeout_s, 0.001))
            return None
        except (can.CanError, OSError) as error:
            self.counters["recv_failed"] += 1
            self._flush()
            self._failing(str(error), timeout_s=min(timeout_s, 0.05))
            return None
        frame = CanFrame(
            self._clock.now_ns(),
            message.arbitration_id,
            bytes(message.data),
            is_extended=message.is_extended_id,
            is_remote=message.is_remote_frame,
            is_error=message.is_error_frame,
            is_own=not message.is_rx,
        )
        if frame.is_error:
            self._error_frames.take(frame)
        else:
            self._working()
        return frame

    def _passes(self, frame: CanFrame) -> bool:
        """Whether the caller asked for such a frame."""
        if frame.is_error or not self._identifiers:
            return True
        return not (frame.is_extended or frame.is_remote) and any(
            (frame.arbitration_id ^ number) & mask == 0 for number, mask in self._identifiers
        )

    def send(self, arbitration_id: int, data: bytes) -> int | None:
        """Send a classic frame; returns when."""
        if self._bus is None:
            return None
        message = can.Message(arbitration_id=arbitration_id, data=data, is_extended_id=False)
        t_ns = self._clock.now_ns()
        try:
            self._bus.send(message)
        except (can.CanError, OSError, ValueError) as error:
            self.counters["send_failed"] += 1
            self._failing(str(error), timeout_s=0.0)
            return None
        return t_ns

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._events.take()

    def close(self) -> None:
        """Shut the bus down; may be called twice."""
        self._is_closed = True
        self._shut_down()

    def _shut_down(self) -> None:
        if self._bus is not None:
            bus, self._bus = self._bus, None
            with contextlib.suppress(can.CanError, OSError):  # an unplugged adapter
                bus.shutdown()

    def _flush(self) -> None:
        """Drop the line that python-can's slcan reader cannot get past."""
        flush = getattr(self._bus, "flush", None)
        if flush is not None:
            with contextlib.suppress(can.CanError, OSError):
                flush()

    def _is_usable(self, timeout_s: float) -> bool:
        """Open a bus again that keeps failing."""
        now_ns = self._clock.now_ns()
        if self._reopen is None or not self._is_failing:
            return self._bus is not None
        if now_ns - self._failing_since_ns < REOPEN_NS:
            if self._bus is None:
                self._clock.sleep_until_ns(now_ns + min(round(timeout_s * 1e9), REOPEN_NS))
            return self._bus is not None
        self._failing_since_ns = now_ns
        self._shut_down()
        try:
            self._bus = self._reopen()
        except (can.CanError, OSError, ValueError):
            return False
        self.counters["reopened"] += 1
        return True

    def _failing(self, why: str, *, timeout_s: float) -> None:
        now_ns = self._clock.now_ns()
        if not self._is_failing:
            self._is_failing = True
            self._failing_since_ns = now_ns
            self._say("warning", why)
        if timeout_s > 0:
            self._clock.sleep_until_ns(now_ns + round(timeout_s * 1e9))

    def _working(self) -> None:
        if self._is_failing:
            self._is_failing = False
            self._say("info", "frames again")

    def _say(self, level: Level, message: str) -> None:
        self._events.add(self._clock.now_ns(), self.name, level, message)


def _check_length(message: can.Message) -> None:
    """Raise ValueError for a data frame whose length is not the one it declares."""
    if message.is_remote_frame or message.is_error_frame or len(message.data) == message.dlc:
        return
    msg = f"frame 0x{message.arbitration_id:X} holds {len(message.data)} bytes of {message.dlc}"
    raise ValueError(msg)


def open_can(
    interface: str,
    channel: str,
    clock: Clock,
    *,
    bitrate: int | None = None,
    identifiers: tuple[tuple[int, int], ...] = (),
    **options: Any,
) -> CanPort:
    """Open a CAN interface by its python-can name.

    Parameters
    ----------
    interface, channel : str
        ``socketcan`` and ``can0``, ``slcan`` and ``/dev/ttyACM0``, ``virtual``, ``simbus``, ...
    clock : Clock
        The steady clock.
    bitrate : int or None
        Bits a second, where the interface sets it.
    identifiers : tuple of (identifier, mask)
        Standard frames to let through; empty = all. Error frames always pass.
    **options
        Further arguments of ``can.Bus``.

    Raises
    ------
    DeviceNotFoundError
        If it cannot be opened; the message names the remedy.
    """
    name = f"can {channel}"
    if interface == "socketcan":
        from drivers.can.socketcan import SocketCanPort  # noqa: PLC0415 - Linux only

        return SocketCanPort(channel, clock, identifiers=identifiers)
    arguments: dict[str, Any] = dict(options)
    if bitrate is not None:
        arguments["bitrate"] = bitrate
    make = partial(can.Bus, interface=interface, channel=channel, **arguments)
    try:
        bus = make()
    except (can.CanError, OSError, ValueError, ImportError) as error:
        msg = (
            f"{name}: interface '{interface}' does not open: {error}; check interface, channel "
            "and permissions"
        )
        raise DeviceNotFoundError(msg) from error
    return PythonCanPort(bus, clock, name=name, reopen=make, identifiers=identifiers)
