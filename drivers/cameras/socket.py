"""``SocketCamera``: frames of another program, through a Unix socket on this machine.

The other program sends GStreamer Data Protocol packets whose presentation stamps are the middle of
the exposure on CLOCK_MONOTONIC; any camera stack that can write a stream can feed a flight.
"""

import contextlib
import select
import socket
from pathlib import Path
from typing import Final

from drivers.cameras.gdp import GdpFrame, GdpParser
from drivers.cameras.newest import NewestFrame
from drivers.cameras.watch import FrameWatch
from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError, FrameFormatError
from drivers.events import Event, EventList
from drivers.samples import Frame

RETRY_NS: Final = 200_000_000
DEAD_NS: Final = 2_000_000_000
READ_BYTES: Final = 1 << 20


class SocketCamera:
    """Frames from a Unix stream socket; a ``Source[Frame]`` that connects again when it breaks.

    Parameters
    ----------
    path : Path
        The listening socket of the program that has the camera.
    clock : Clock
        The steady clock.
    camera : str
        Name that the frames carry.
    fps : float
        Nominal frame rate, 1/s.

    Raises
    ------
    DeviceNotFoundError
        If nobody listens there.
    """

    def __init__(
        self, path: Path, clock: Clock, *, camera: str = "root", fps: float = 30.0
    ) -> None:
        self.name = f"camera {camera}"
        self._path, self._clock, self._camera = path, clock, camera
        self._events, self._watch = EventList(), FrameWatch(fps)
        self._newest = NewestFrame(self._watch, clock)
        self._socket: socket.socket | None = None
        self._retry_ns = 0
        self._is_closed = False
        error = self._connect()
        if error is not None:
            msg = (
                f"{self.name}: nobody serves frames at {path} ({error.strerror}); start the "
                "program that has the camera first"
            )
            raise DeviceNotFoundError(msg) from error

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest frame, None if none came within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        self._catch_up()
        while not self._newest.is_there and not self._is_closed:
            now_ns = self._clock.now_ns()
            if self._socket is None and now_ns >= self._retry_ns and self._connect() is None:
                self._events.add(now_ns, self.name, "info", "connected again")
            if self._socket is None:
                self._clock.sleep_until_ns(min(deadline_ns, self._retry_ns))
            else:
                self._receive(max(0, deadline_ns - now_ns))
                self._check_alive()
                self._catch_up()
            if self._clock.now_ns() >= deadline_ns:
                break
        return self._newest.take()

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source."""
        return {self.name: dict(self._watch.counters)}

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._events.take()

    def close(self) -> None:
        """Hang up; may be called twice."""
        self._is_closed = True
        self._hang_up()

    def _connect(self) -> OSError | None:
        self._retry_ns = self._clock.now_ns() + RETRY_NS
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.connect(str(self._path))
        except OSError as error:
            connection.close()
            return error
        connection.setblocking(False)
        self._socket, self._parser = connection, GdpParser()
        self._watch.restart()
        self._heard_ns = self._clock.now_ns()
        return None

    def _catch_up(self) -> None:
        self._newest.catch_up(self._receive, lambda: self._parser.is_midway)

    def _receive(self, wait_ns: int) -> int:
        """Wait for data and take them; returns how many bytes they were."""
        if self._socket is None:
            return 0
        ready, _, _ = select.select([self._socket], [], [], wait_ns * 1e-9)
        if not ready:
            return 0
        data = b""
        with contextlib.suppress(ConnectionError):
            # No more than this packet: of what follows a failure nothing is taken.
            data = self._socket.recv(min(self._parser.missing, READ_BYTES))
        if not data:
            self._fail("the program that has the camera hung up")
        self._heard_ns = self._clock.now_ns()
        try:
            for frame in self._parser.feed(data):
                self._take(frame)
        except FrameFormatError as error:
            self._fail(str(error))
        return len(data)

    def _take(self, frame: GdpFrame) -> None:
        t_ns = self._heard_ns if frame.pts_ns is None else frame.pts_ns
        if self._watch.is_good(t_ns, frame.image):
            self._newest.put(Frame(t_ns, self._camera, self._watch.index, frame.image))
        if self._watch.is_frozen(t_ns):
            self._watch.counters["frozen"] += 1
            self._watch.expect_still_pictures()
            self._fail("the picture is frozen")

    def _check_alive(self) -> None:
        silent_ns = self._clock.now_ns() - self._heard_ns
        if self._socket is not None and silent_ns > DEAD_NS:
            self._watch.counters["dead"] += 1
            self._fail(f"no frame for {silent_ns * 1e-9:.1f} s")

    def _fail(self, why: str) -> None:
        self._watch.counters["restarts"] += 1
        self._events.add(self._clock.now_ns(), self.name, "warning", f"{why}; connecting again")
        self._hang_up()

    def _hang_up(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            self._retry_ns = self._clock.now_ns() + RETRY_NS
