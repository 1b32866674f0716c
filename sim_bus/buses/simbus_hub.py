"""The hub of a simulated CAN bus between processes: what one client sends, all others get."""

import contextlib
import fcntl
import os
import selectors
import socket
import tempfile
import threading
from collections import deque
from pathlib import Path
from typing import IO, Final

LARGEST_PACKET: Final = 128
# Sent to a client once it is one: what others send from then on reaches it.
WELCOME: Final = b"simbus 1"
# A client that does not read loses frames beyond this, as a CAN controller would.
BACKLOG_PACKETS: Final = 10_000


def socket_path(channel: str) -> Path:
    """Return the Unix socket of a channel: a path as it is, a name below the user's own folder."""
    if "/" in channel:
        return Path(channel)
    base = os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()
    folder = Path(base) / f"simbus-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder / f"{channel}.sock"


class Hub:
    """Serves one channel from its own thread while its process lives.

    Parameters
    ----------
    path : Path
        The Unix socket.

    Raises
    ------
    BlockingIOError
        If another process serves the channel already.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock: IO[str] = path.with_suffix(".lock").open("w", encoding="ascii")
        try:
            # Released by the kernel with the process, however it ends.
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._lock.close()
            raise
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with contextlib.suppress(FileNotFoundError):
            path.unlink()  # what a killed hub left
        self._server.bind(str(path))
        self._server.listen()
        self._server.setblocking(False)
        self._waker, self._wake = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._server, selectors.EVENT_READ)
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._backlogs: dict[socket.socket, deque[bytes]] = {}
        self._thread = threading.Thread(target=self._serve, name=f"simbus {path.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving; the clients will find or make another hub."""
        if self._thread.is_alive():
            self._waker.send(b"x")
            self._thread.join(timeout=2.0)
        with contextlib.suppress(OSError):
            self._path.unlink()
        self._lock.close()

    def wait(self) -> None:
        """Return when the hub has ended."""
        self._thread.join()

    def _serve(self) -> None:
        is_open = True
        while is_open:
            for key, events in self._selector.select():
                if key.fileobj is self._wake:
                    is_open = False
                elif key.fileobj is self._server:
                    self._accept()
                else:
                    assert isinstance(key.fileobj, socket.socket)
                    self._attend(key.fileobj, events)
        for client in list(self._backlogs):
            self._drop(client)
        for endpoint in (self._server, self._wake, self._waker):
            endpoint.close()
        self._selector.close()

    def _accept(self) -> None:
        client, _ = self._server.accept()
        client.setblocking(False)
        self._backlogs[client] = deque([WELCOME], maxlen=BACKLOG_PACKETS)
        self._selector.register(client, selectors.EVENT_READ)
        self._flush(client)

    def _attend(self, client: socket.socket, events: int) -> None:
        if client not in self._backlogs:
            return  # dropped earlier in the same round
        if events & selectors.EVENT_WRITE:
            self._flush(client)
        if not events & selectors.EVENT_READ or client not in self._backlogs:
            return
        try:
            packet = client.recv(LARGEST_PACKET)
        except OSError:
            packet = b""
        if not packet:
            self._drop(client)
            return
        for other in list(self._backlogs):
            if other is not client:
                self._backlogs[other].append(packet)
                self._flush(other)

    def _flush(self, client: socket.socket) -> None:
        backlog = self._backlogs[client]
        try:
            while backlog:
                client.send(backlog[0])
                backlog.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self._drop(client)
            return
        wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if backlog else 0)
        self._selector.modify(client, wanted)

    def _drop(self, client: socket.socket) -> None:
        self._selector.unregister(client)
        del self._backlogs[client]
        client.close()
