"""How a command reaches a running bench; loads nothing of the simulation."""

import json
import os
import socket
import tempfile
from pathlib import Path
from typing import Any, Final

from drivers.errors import DeviceNotFoundError, DriverError

Answer = dict[str, Any]
LARGEST_BYTES: Final = 65536
TIMEOUT_S: Final = 5.0


class RefusedError(DriverError):
    """The bench cannot do what was asked."""


def default_socket() -> Path:
    """Return the control socket that every command uses by default."""
    base = os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()
    folder = Path(base) / f"avionics-rig-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder / "control.sock"


def ask(path: Path, request: Answer) -> Answer:
    """Return a running bench's answer to a command.

    Raises
    ------
    DeviceNotFoundError
        If no bench answers there.
    RefusedError
        If it cannot do what was asked.
    """
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(TIMEOUT_S)
        connection.connect(str(path))
        connection.sendall(json.dumps(request).encode() + b"\n")
        with connection.makefile("rb") as lines:
            line = lines.readline(LARGEST_BYTES)
    except OSError as error:
        msg = f"no bench answers at {path} ({error}); start one with `avionics rig serve`"
        raise DeviceNotFoundError(msg) from error
    finally:
        connection.close()
    answer = json.loads(line or b'{"error": "the bench hung up"}')
    if "error" in answer:
        raise RefusedError(str(answer["error"]))
    return dict(answer)
