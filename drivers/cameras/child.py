"""A child process that cannot outlive its parent."""

import ctypes
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from typing import Final

_PR_SET_PDEATHSIG: Final = 1
_LIBC = ctypes.CDLL(None, use_errno=True)


def start_child(
    command: Sequence[str], *, environment: Mapping[str, str] | None = None
) -> "subprocess.Popen[bytes]":
    """Start a process with its output and errors on pipes; SIGKILL reaches it with the parent.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    environment : mapping, optional
        Added to this process's environment.

    Raises
    ------
    OSError
        If the program cannot be started.

    Notes
    -----
    The kernel sends the signal when the *thread* that started the child ends. Start children from
    a thread that lives as long as they shall.
    """
    parent = os.getpid()

    def die_with_parent() -> None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))
        if os.getppid() != parent:  # it died before the call
            os.kill(os.getpid(), signal.SIGKILL)

    return subprocess.Popen(
        list(command),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        bufsize=0,
        env={**os.environ, **(environment or {})},
        preexec_fn=die_with_parent,  # noqa: PLW1509 - one system call, nothing that takes a lock
    )
