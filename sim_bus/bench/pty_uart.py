"""A chip's serial line behind a genuine pty, or on a real serial port at the end of a cable."""

import contextlib
import os
import select
import threading
import tty
from typing import Final

import serial

from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from sim_bus.buses.uart import SimSerialPort

IDLE_S: Final = 0.05


class PtyUart:
    """Carries bytes between a terminal and a simulated serial port.

    Parameters
    ----------
    port : SimSerialPort
        The chip's end, on a clock that runs by itself.
    clock : Clock
        That clock.
    device : str, optional
        A real serial port to serve; without one a pty is made.
    baud : int
        Line speed of the real port.

    Attributes
    ----------
    path : str
        What the other side opens: the pty, or the name of the real port on this machine.

    Raises
    ------
    DeviceNotFoundError
        If the real port does not open.
    """

    def __init__(
        self, port: SimSerialPort, clock: Clock, *, device: str | None = None, baud: int = 115200
    ) -> None:
        self._port, self._clock = port, clock
        self._line: serial.Serial | None = None
        self._slave = -1
        if device is None:
            self._fd, self._slave = os.openpty()
            for end in (self._fd, self._slave):
                tty.setraw(end)
            self.path = os.ttyname(self._slave)
        else:
            try:
                self._line = serial.Serial(device, baud, timeout=0, exclusive=True)
            except (OSError, ValueError) as error:
                msg = f"serial port {device} does not open: {error}; see `ls /dev/tty*`"
                raise DeviceNotFoundError(msg) from error
            self._fd, self.path = self._line.fileno(), device
        self._port.timeout = 0.0
        self._is_open = True
        self._thread = threading.Thread(target=self._carry, name=f"uart {self.path}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take the line away; may be called twice."""
        if not self._is_open:
            return
        self._is_open = False
        self._thread.join(1.0)
        if self._line is not None:
            self._line.close()
        else:
            os.close(self._fd)
            os.close(self._slave)
        self._port.close()

    def _carry(self) -> None:
        while self._is_open:
            due_ns = self._port.next_ns
            wait_s = IDLE_S if due_ns is None else (due_ns - self._clock.now_ns()) * 1e-9
            ready, _, _ = select.select([self._fd], [], [], min(max(0.0, wait_s), IDLE_S))
            with contextlib.suppress(OSError):
                if ready:
                    self._port.write(os.read(self._fd, 256))
                if answer := self._port.read(256):
                    os.write(self._fd, answer)
