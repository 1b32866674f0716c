"""A guest's process on the host: it ends with its parent, also when that is stopped or killed."""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Final, TextIO

_PR_SET_PDEATHSIG: Final = 1
_LIBC = ctypes.CDLL(None, use_errno=True)
ENDING: Final = (signal.SIGTERM, signal.SIGHUP)


class GuestTimeoutError(Exception):
    """The guest ran longer than it may."""


def run_process(
    arguments: Sequence[str],
    out: Path,
    *,
    limit_s: float,
    echo: bool,
    environment: Mapping[str, str] | None = None,
    cpu: int | None = None,
) -> None:
    """Run the process that is the guest, and end it and all that it started.

    Parameters
    ----------
    arguments : sequence of str
        The emulator or kernel with its arguments.
    out : Path
        The shared folder; ``console`` is written there.
    limit_s : float
        Longest life, s.
    echo : bool
        Copy ``stdout`` and ``stderr`` of that folder to this process's own.
    environment : mapping, optional
        Variables added to this process's.
    cpu : int, optional
        The one CPU for it and all that it starts; any if absent.

    Raises
    ------
    GuestTimeoutError
        If it ran longer.
    SystemExit
        If this process got SIGTERM or SIGHUP meanwhile and had no handler of its own.
    """
    with _exit_on_signals(), (out / "console").open("wb") as console:
        guest = subprocess.Popen(
            arguments,
            stdin=subprocess.DEVNULL,
            stdout=console,
            stderr=subprocess.STDOUT,
            env={**os.environ, **(environment or {})},
            start_new_session=True,
            preexec_fn=_dying_with(os.getpid(), cpu),  # noqa: PLW1509 - system calls, no lock
        )
        try:
            with _watched(guest.pid), _echoing(out, echo):
                guest.wait(limit_s)
        except subprocess.TimeoutExpired:
            raise GuestTimeoutError from None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(guest.pid, signal.SIGKILL)
            guest.wait()


def _dying_with(parent: int, cpu: int | None = None) -> Callable[[], None]:
    """Return what a child calls so that the kernel kills it when its parent's thread ends."""

    def ask() -> None:
        if cpu is not None:
            os.sched_setaffinity(0, {cpu})
        _LIBC.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))
        if os.getppid() != parent:  # it died before the call
            os.kill(os.getpid(), signal.SIGKILL)

    return ask


@contextlib.contextmanager
def _watched(group: int) -> Iterator[None]:
    """Have a shell kill the group when this process is gone, whose end closes the shell's input.

    User Mode Linux is several processes, of which the kernel's signal reaches only the first.
    """
    watcher = subprocess.Popen(
        ["sh", "-c", 'read -r _; kill -9 "-$1"', "sh", str(group)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield
    finally:
        watcher.kill()  # before its input ends: the group's number may soon be another's
        watcher.wait()
        assert watcher.stdin is not None
        watcher.stdin.close()


@contextlib.contextmanager
def _exit_on_signals() -> Iterator[None]:
    """Turn signals that would end this process at once into SystemExit, so that it can clean up."""

    def leave(number: int, _: FrameType | None) -> None:
        sys.exit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours = [number for number in ENDING if signal.getsignal(number) is signal.SIG_DFL]
    for number in ours:
        signal.signal(number, leave)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


@contextlib.contextmanager
def _echoing(out: Path, echo: bool) -> Iterator[None]:
    if not echo:
        yield
        return
    tails = [_tail(out / "stdout", sys.stdout), _tail(out / "stderr", sys.stderr)]
    try:
        yield
    finally:
        for tail in tails:
            tail.terminate()
            tail.wait()


def _tail(path: Path, stream: TextIO) -> "subprocess.Popen[bytes]":
    path.touch()
    return subprocess.Popen(
        ["tail", "-c", "+1", "-s", "0.1", "-f", str(path)],
        stdout=stream,
        stderr=subprocess.DEVNULL,
        preexec_fn=_dying_with(os.getpid()),  # noqa: PLW1509 - one system call, takes no lock
    )
