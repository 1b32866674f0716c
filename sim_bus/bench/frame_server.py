"""Serves frames through a Unix socket in GStreamer Data Protocol, newest first, to any reader."""

import contextlib
import socket
import struct
import threading
from pathlib import Path
from typing import Final

import numpy as np

from drivers.samples import Frame
from sim_bus.bench.unix_socket import listen_at

BUFFER, CAPS = 1, 2
HEADER_BYTES = 62
NO_VALUE = (1 << 64) - 1
# A reader that takes nothing for so long is gone.
STUCK_S: Final = 5.0


def packet(kind: int, payload: bytes, pts_ns: int = NO_VALUE) -> bytes:
    """Return one packet of GDP 1.0 without check sums."""
    header = struct.pack(">BBBBHIQ", 1, 0, 0, 0, kind, len(payload), pts_ns)
    return header.ljust(HEADER_BYTES, b"\0") + payload


def caps_packet(frame: Frame, fps: float) -> bytes:
    """Return the packet that announces the form of the pictures."""
    height, width = frame.image.shape[:2]
    form = "GRAY8" if frame.image.ndim == 2 else "BGR"
    text = (
        f"video/x-raw, format=(string){form}, width=(int){width}, height=(int){height}, "
        f"framerate=(fraction){round(fps * 1000)}/1000"
    )
    return packet(CAPS, text.encode() + b"\0")


class FrameServer:
    """Sends each frame to whoever is connected; a reader that is too slow misses frames.

    Parameters
    ----------
    path : Path
        The socket to make; its folder must exist.
    fps : float
        Nominal frame rate, 1/s.

    Attributes
    ----------
    sent, missed : int
        Frames that went out, and frames that a newer one replaced before a reader took them.

    Raises
    ------
    DeviceNotFoundError
        If the socket cannot be made.
    RefusedError
        If another server answers on it.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self.path, self._fps = path, fps
        self.sent = self.missed = 0
        self._listener = listen_at(path, "camera socket")
        self._readers: list[_Reader] = []
        self._is_open = True
        self._thread = threading.Thread(target=self._accept, name=f"frames {path}", daemon=True)
        self._thread.start()

    @property
    def is_watched(self) -> bool:
        """Whether anybody is connected: nothing needs to be painted otherwise."""
        return bool(self._readers)

    @property
    def counters(self) -> dict[str, int]:
        """Frames sent and missed."""
        return {"sent": self.sent, "missed": self.missed}

    def send(self, frame: Frame) -> None:
        """Offer a frame to every reader; one that hung up is forgotten."""
        height, width = frame.image.shape[:2]
        channels = 1 if frame.image.ndim == 2 else 3
        rows = frame.image.reshape(height, width * channels)
        spare = -(width * channels) % 4
        payload = np.pad(rows, ((0, 0), (0, spare))).tobytes() if spare else rows.tobytes()
        data = caps_packet(frame, self._fps) + packet(BUFFER, payload, frame.t_ns)
        for reader in list(self._readers):
            if reader.is_gone:
                self._readers.remove(reader)
                reader.close()
            elif reader.offer(data):
                self.sent += 1
            else:
                self.missed += 1

    def close(self) -> None:
        """Hang up and remove the socket; may be called twice."""
        self._is_open = False
        self._thread.join(1.0)
        for reader in self._readers:
            reader.close()
        self._readers.clear()
        self._listener.close()
        self.path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while self._is_open:
            with contextlib.suppress(TimeoutError, OSError):
                connection, _ = self._listener.accept()
                self._readers.append(_Reader(connection))


class _Reader:
    """One reader with room for one frame, the newest."""

    def __init__(self, connection: socket.socket) -> None:
        self.is_gone = False
        self._connection = connection
        self._connection.settimeout(STUCK_S)
        self._waiting: bytes | None = None
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._send, name="frame reader", daemon=True)
        self._thread.start()

    def offer(self, data: bytes) -> bool:
        """Put a frame in the only place; returns whether that place was free."""
        with self._news:
            was_free, self._waiting = self._waiting is None, data
            self._news.notify()
        return was_free

    def close(self) -> None:
        """Hang up."""
        with self._news:
            self.is_gone = True
            self._news.notify()
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._thread.join(1.0)
        self._connection.close()

    def _send(self) -> None:
        while not self.is_gone:
            with self._news:
                self._news.wait_for(lambda: self._waiting is not None or self.is_gone, timeout=1.0)
                data, self._waiting = self._waiting, None
            if data is None:
                continue
            try:
                self._connection.sendall(data)
            except OSError:
                self.is_gone = True
