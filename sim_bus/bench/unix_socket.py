"""A Unix socket to listen on: a killed server's is replaced, a living one is never touched."""

import fcntl
import os
import socket
import stat
from pathlib import Path

from drivers.errors import DeviceNotFoundError
from sim_bus.bench.client import RefusedError

CONNECT_S = 2.0


def listen_at(path: Path, what: str) -> socket.socket:
    """Return a socket that listens at a path.

    Parameters
    ----------
    path : Path
        Where; its folder must exist.
    what : str
        What the socket is, for messages.

    Raises
    ------
    RefusedError
        If somebody answers there, or something else than a socket lies there.
    DeviceNotFoundError
        If it cannot be made.
    """
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        # Of two that come at once, one finds the other listening.
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            _clear(path, what)
            listener.bind(str(path))
            path.chmod(0o600)
            listener.listen(4)
        finally:
            os.close(folder)
    except OSError as error:
        listener.close()
        msg = f"{what} {path}: {error}; give a short path in a folder of your own (--control)"
        raise DeviceNotFoundError(msg) from error
    except RefusedError:
        listener.close()
        raise
    listener.settimeout(0.2)
    return listener


def _clear(path: Path, what: str) -> None:
    """Remove a socket on which nobody answers."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(mode):
        msg = f"{what} {path}: is a file of another kind; choose another place with --control"
        raise RefusedError(msg)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
        caller.settimeout(CONNECT_S)
        try:
            caller.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except (BlockingIOError, TimeoutError):
            pass  # it listens, and is busy
    msg = f"{what} {path}: another bench runs there; give this one a --control in its own folder"
    raise RefusedError(msg)
