"""SocketCAN with its own receive path, because python-can cannot count what the kernel dropped.

The kernel stamps reception on CLOCK_REALTIME; each stamp is turned to the steady clock by the age
it has when it is read, so that a step of CLOCK_REALTIME bends nothing. Losses of the receive
buffer are counted (SO_RXQ_OVFL), error frames pass, and the port returns by itself after the link
was down, the controller off the bus, or the interface deleted and made again.
"""

import errno
import select
import socket
import struct
from collections import Counter, deque
from pathlib import Path
from typing import Final

from drivers.can.error_frames import ErrorFrames
from drivers.can.port import CanFrame
from drivers.clock import Clock, SteadyStamps, read_both_ns
from drivers.errors import DeviceNotFoundError
from drivers.events import Event, EventList, Level

RECEIVE_BUFFER_BYTES: Final = 1 << 20
RETRY_NS: Final = 200_000_000
AT_ONCE: Final = 64
"""Frames taken from the kernel in one go."""
SO_RCVBUFFORCE, SO_RXQ_OVFL, SO_TIMESTAMPNS = 33, 40, 35
SOL_CAN_RAW, CAN_RAW_FILTER, CAN_RAW_ERR_FILTER, CAN_RAW_RECV_OWN_MSGS = 101, 1, 2, 4
MSG_CONFIRM: Final = 0x800
CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_ERR_FLAG = 0x8000_0000, 0x4000_0000, 0x2000_0000
CAN_EFF_MASK, CAN_SFF_MASK, CAN_ERR_MASK = 0x1FFF_FFFF, 0x7FF, 0x1FFF_FFFF
_FRAME: Final = struct.Struct("=IB3x8s")
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(16) + socket.CMSG_SPACE(4)
_GONE: Final = (errno.ENODEV, errno.ENXIO, errno.EBADF)


class SocketCanPort:
    """One SocketCAN interface as a ``CanPort``.

    Parameters
    ----------
    channel : str
        Name of the interface, e.g. ``can0``.
    clock : Clock
        The steady clock.
    identifiers : tuple of (identifier, mask)
        Standard frames to let through; empty = all.
    receive_buffer_bytes : int
        Asked for as SO_RCVBUFFORCE, failing that as SO_RCVBUF; the default of the kernel holds
        278 frames only.

    Raises
    ------
    DeviceNotFoundError
        If there is no such interface, or no SocketCAN.
    """

    echoes = True

    def __init__(
        self,
        channel: str,
        clock: Clock,
        *,
        identifiers: tuple[tuple[int, int], ...] = (),
        receive_buffer_bytes: int = RECEIVE_BUFFER_BYTES,
    ) -> None:
        self.name = f"can {channel}"
        self.counters: Counter[str] = Counter()
        self.receive_buffer_bytes = 0
        self._channel = channel
        self._clock = clock
        self._identifiers = identifiers
        self._wanted_bytes = receive_buffer_bytes
        self._events = EventList()
        self._error_frames = ErrorFrames(self.counters, self._say)
        self._socket: socket.socket | None = None
        self._stamps = SteadyStamps()
        self._waiting: deque[CanFrame] = deque()
        self._overflow = 0
        self._retry_ns = 0
        self._is_down = self._is_closed = False
        self._trouble_ns = 0
        try:
            self._socket = self._open()
        except OSError as error:
            raise DeviceNotFoundError(self._advice(error)) from error
        if not self._is_link_up():
            self._say("warning", f"link is down; `ip link set {channel} up` brings it up")
            self._is_down, self._trouble_ns = True, clock.now_ns()

    def recv(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame, None if none came in time or the bus is down just now."""
        if self._waiting:
            return self._waiting.popleft()
        if self._is_closed or not self._is_usable(timeout_s):
            return None
        self._take_all()
        if not self._waiting and timeout_s > 0 and self._socket is not None:
            try:
                select.select([self._socket], [], [], timeout_s)
            except OSError as error:
                self._failed("recv_failed", error)
                return None
            self._take_all()
        return self._waiting.popleft() if self._waiting else None

    def _take_all(self) -> None:
        """Take what the kernel holds; reading both clocks costs more than reading a frame."""
        assert self._socket is not None
        taken: list[tuple[bytes, int | None, int]] = []
        failure: OSError | None = None
        try:
            while len(taken) < AT_ONCE:
                data, ancillary, flags, _ = self._socket.recvmsg(_FRAME.size, _ANCILLARY_BYTES)
                taken.append((data, self._read_ancillary(ancillary), flags))
        except BlockingIOError:
            pass
        except OSError as error:
            failure = error
        if taken:
            steady_ns, realtime_ns = read_both_ns(self._clock)
            for data, stamp_ns, flags in taken:
                if len(data) != _FRAME.size:
                    self.counters["malformed"] += 1
                    continue
                t_ns = steady_ns
                if stamp_ns is not None:
                    t_ns = self._stamps.convert(stamp_ns, steady_ns, realtime_ns)
                frame = self._frame(data, t_ns, is_own=bool(flags & MSG_CONFIRM))
                self._waiting.append(frame)
                self._heard(frame)
        if failure is not None:
            self._failed("recv_failed", failure)

    def send(self, arbitration_id: int, data: bytes) -> int | None:
        """Send a classic frame; returns when it was handed to the kernel, None if it was not."""
        if self._is_closed or self._socket is None:
            return None
        frame = _FRAME.pack(arbitration_id, len(data), data.ljust(8, b"\x00"))
        t_ns = self._clock.now_ns()
        try:
            self._socket.send(frame)
        except OSError as error:
            if error.errno in (errno.ENOBUFS, errno.EAGAIN):
                self.counters["send_queue_full"] += 1
            else:
                self._failed("send_failed", error)
            return None
        return t_ns

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        self.counters["realtime_steps"] = self._stamps.steps
        return self._events.take()

    def close(self) -> None:
        """Close the socket; may be called twice."""
        self._is_closed = True
        self._drop_socket()

    def _open(self) -> socket.socket:
        raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        try:
            try:
                raw.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, self._wanted_bytes)
            except PermissionError:
                raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._wanted_bytes)
            self.receive_buffer_bytes = raw.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
            raw.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
            raw.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            raw.setsockopt(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, CAN_ERR_MASK)
            raw.setsockopt(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1)
            if self._identifiers:
                # The flags are part of the mask, so that extended frames do not pass.
                pairs = (
                    struct.pack("=II", i, mask | CAN_EFF_FLAG | CAN_RTR_FLAG)
                    for i, mask in self._identifiers
                )
                raw.setsockopt(SOL_CAN_RAW, CAN_RAW_FILTER, b"".join(pairs))
            raw.bind((self._channel,))
            raw.setblocking(False)
        except OSError:
            raw.close()
            raise
        self._overflow = 0
        return raw

    def _is_usable(self, timeout_s: float) -> bool:
        """Reopen a lost socket when it is time to."""
        if self._socket is not None:
            return True
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_ns:
            wait_ns = min(round(timeout_s * 1e9), self._retry_ns - now_ns)
            self._clock.sleep_until_ns(now_ns + wait_ns)
            return False
        try:
            self._socket = self._open()
        except OSError:
            self._retry_ns = now_ns + RETRY_NS
            return False
        self.counters["reopened"] += 1
        return True

    def _failed(self, counter: str, error: OSError) -> None:
        self.counters[counter] += 1
        self._trouble_ns = self._clock.now_ns()
        if not self._is_down:
            self._is_down = True
            self._say(
                "warning", f"{error.strerror} (errno {error.errno}); waiting for it to return"
            )
        if error.errno in _GONE:
            self._drop_socket()
            self._retry_ns = self._clock.now_ns() + RETRY_NS
        elif error.errno == errno.ENETDOWN and self._has_vanished():
            # A deleted interface also gives ENETDOWN once, and nothing after that.
            self._drop_socket()

    def _has_vanished(self) -> bool:
        return not Path(f"/sys/class/net/{self._channel}").exists()

    def _is_link_up(self) -> bool:
        try:
            flags = int(
                Path(f"/sys/class/net/{self._channel}/flags").read_text(encoding="ascii"), 16
            )
        except (OSError, ValueError):
            return True  # unknown, so nothing to complain about
        return bool(flags & 1)

    def _heard(self, frame: CanFrame) -> None:
        """Report the return, unless the frame was queued before the fault or describes it."""
        is_news = frame.t_ns > self._trouble_ns and not frame.is_error
        if self._is_down and is_news and self._is_link_up():
            self._is_down = False
            self.counters["returned"] += 1
            self._say("info", "frames again")

    def _read_ancillary(self, ancillary: list[tuple[int, int, bytes]]) -> int | None:
        stamp_ns = None
        for level, kind, data in ancillary:
            if level != socket.SOL_SOCKET:
                continue
            if kind == SO_TIMESTAMPNS and len(data) >= 16:
                seconds, nanoseconds = struct.unpack("=qq", data[:16])
                stamp_ns = seconds * 1_000_000_000 + nanoseconds
            elif kind == SO_RXQ_OVFL and len(data) >= 4:
                (overflow,) = struct.unpack("=I", data[:4])
                if overflow != self._overflow:
                    if not self.counters["rx_dropped"]:
                        self._say(
                            "warning", "frames lost in the receive buffer; the reader is late"
                        )
                    self.counters["rx_dropped"] += (overflow - self._overflow) % (1 << 32)
                    self._overflow = overflow
        return stamp_ns

    def _frame(self, data: bytes, t_ns: int, *, is_own: bool) -> CanFrame:
        identifier, length, payload = _FRAME.unpack(data)
        is_error = bool(identifier & CAN_ERR_FLAG)
        is_extended = bool(identifier & CAN_EFF_FLAG)
        number = identifier & (CAN_EFF_MASK if is_error or is_extended else CAN_SFF_MASK)
        frame = CanFrame(
            t_ns,
            number,
            payload[: min(length, 8)],
            is_extended=is_extended,
            is_remote=bool(identifier & CAN_RTR_FLAG),
            is_error=is_error,
            is_own=is_own,
        )
        if is_error:
            self._error_frames.take(frame)
        return frame

    def _advice(self, error: OSError) -> str:
        if error.errno in (errno.ENODEV, errno.ENXIO):
            return (
                f"{self.name}: no such interface; for hardware `ip link set {self._channel} up "
                f"type can bitrate 500000 restart-ms 100`, without `ip link add {self._channel} "
                "type vcan`"
            )
        if error.errno in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT):
            return f"{self.name}: this kernel has no SocketCAN; `modprobe can_raw`"
        if error.errno in (errno.EPERM, errno.EACCES):
            return f"{self.name}: no permission to open it: {error.strerror}"
        return f"{self.name}: does not open: {error.strerror} (errno {error.errno})"

    def _drop_socket(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _say(self, level: Level, message: str) -> None:
        self._events.add(self._clock.now_ns(), self.name, level, message)
