"""A driver for a gyro of your own: here one that prints a line of text for every sample.

A driver is a class with ``read(timeout_s)`` and ``close()`` that returns ``ImuSample`` records. It
needs no base class and no registration to be tried; to fly by configuration it gets a link in
``avionics/config/`` and one line in ``avionics/flight/assemble.py``, see CONTRIBUTING.md.

    .venv/bin/python examples/own_driver.py
"""

import math
from itertools import pairwise

import numpy as np

from drivers.clock import Clock
from drivers.errors import FrameFormatError
from drivers.interfaces import SerialPort
from drivers.samples import ImuSample
from sim_bus.clock import SimClock


class TextGyro:
    """Reads lines ``number,P,Q,R`` (rates in deg/s) from a serial port; a ``Source[ImuSample]``.

    Parameters
    ----------
    pod : str
        Identifier of the pod as in the configuration.
    port : SerialPort
        Where the lines come from.
    clock : Clock
        The steady clock: the stamp is the arrival of the line's last byte.
    line_s : float
        Time that a line takes on the wire, s; the sample is older by that.
    """

    def __init__(self, pod: str, port: SerialPort, clock: Clock, *, line_s: float = 0.0) -> None:
        self._pod = pod
        self._port = port
        self._clock = clock
        self._line_ns = round(1e9 * line_s)
        self._received = b""
        self.damaged = 0

    def read(self, timeout_s: float) -> ImuSample | None:
        """Return the next sample, or None if none came within ``timeout_s``."""
        self._port.timeout = timeout_s
        while b"\n" not in self._received:
            more = self._port.read(64)
            if not more:
                return None
            self._received += more
        line, _, self._received = self._received.partition(b"\n")
        try:
            return self._sample(line.decode("ascii"))
        except (UnicodeDecodeError, FrameFormatError):
            self.damaged += 1  # counted, never raised: a damaged line costs itself
            return None

    def _sample(self, line: str) -> ImuSample:
        fields = line.strip().split(",")
        if len(fields) != 4:
            msg = f"pod {self._pod}: line '{line}' has {len(fields)} fields, expected number,P,Q,R"
            raise FrameFormatError(msg)
        try:
            number, *rate_dps = int(fields[0]), *map(float, fields[1:])
        except ValueError as error:
            msg = f"pod {self._pod}: line '{line}' holds something else than numbers"
            raise FrameFormatError(msg) from error
        t_ns = self._clock.now_ns() - self._line_ns
        return ImuSample(t_ns, self._pod, number, np.radians(np.array(rate_dps)))

    def close(self) -> None:
        """Release the port; may be called twice."""
        self._port.close()


class SimPort:
    """A serial port that swings: one line every 10 ms, one of them damaged."""

    def __init__(self, clock: SimClock) -> None:
        self.timeout: float | None = None
        self._clock = clock
        self._number = 0

    def read(self, size: int = 1) -> bytes:
        """Return up to ``size`` bytes."""
        self._clock.sleep_until_ns(self._clock.now_ns() + 10_000_000)
        self._number += 1
        swing_dps = 30.0 * math.cos(2.0 * math.pi * 1.5 * self._clock.now_ns() * 1e-9)
        line = f"{self._number},{swing_dps:.3f},0.0,0.0\n"
        return b"7,\xff,\n" if self._number == 7 else line.encode()[:size]

    def write(self, data: bytes) -> int | None:
        """Take nothing."""
        return len(data)

    def reset_input_buffer(self) -> None:
        """Keep everything."""

    def close(self) -> None:
        """Do nothing."""


def main() -> list[ImuSample]:
    """Read half a second of samples."""
    clock = SimClock()
    driver = TextGyro("tip", SimPort(clock), clock, line_s=2e-3)
    samples = [sample for _ in range(50) if (sample := driver.read(0.02)) is not None]
    driver.close()
    losses = sum(b.seq - a.seq - 1 for a, b in pairwise(samples))
    print(f"{len(samples)} samples, {losses} missing in between, {driver.damaged} lines damaged")
    return samples


if __name__ == "__main__":
    main()
