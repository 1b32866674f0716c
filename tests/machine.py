"""How fast this machine does the work of the wall-clock tests, measured before each of them.

What runs against the wall clock scales its load (rates, pictures, duration) by it; its bounds stay.
The reference work is a transfer as they make it: a request to another process, a few dozen
operations on small arrays on either side, and the answer. Its time is the wall clock's, so that a
slow CPU, a shared one and one held back by a quota all count.
"""

import os
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

import numpy as np

from sim_bus.guests.guest import guest_kind
from sim_bus.guests.uml import quietest_cpu

# Transfers a second where the loads of full size were measured, an idle two-core virtual machine;
# in User Mode Linux a system call takes its own time.
REFERENCE_HZ: Final = {None: 16000.0, "uml": 6000.0}
# Below it what remains of a load proves no more.
LEAST: Final = 0.15
# From here on the load is whole: one measurement differs from the next by a fifth.
FULL_LOAD: Final = 0.8
# What a pod's firmware can do: a whole number of milliseconds.
RATES_HZ: Final = (100, 50, 40, 25, 20, 10)
MEASURE_S: Final = 1.5
_REQUEST: Final = struct.Struct("<qd")


def work(request: bytes) -> bytes:
    """Return the answer to a request: the work of one side of a transfer."""
    count, value = _REQUEST.unpack(request)
    vector = np.array([value, 1.0, 2.0])
    for _ in range(6):
        vector = np.asarray(vector * 0.5 + np.array([0.1, 0.2, 0.3]))
    digits = [(count >> shift) & 0xFF for shift in range(40)]
    return _REQUEST.pack(count + len(digits), float(vector.sum()))


def speed(seconds: float = MEASURE_S) -> float:
    """Return how fast this machine is, 1 at most: what a load of full size wants.

    Both processes take turns on one CPU: waking an idle one costs more than the work, and how much
    is another matter than speed.
    """
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {quietest_cpu()})
    try:
        return min(1.0, _transfers_hz(seconds) / REFERENCE_HZ[guest_kind()])
    finally:
        os.sched_setaffinity(0, allowed)


def _transfers_hz(seconds: float) -> float:
    other = subprocess.Popen(
        [sys.executable, str(Path(__file__))], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        bufsize=0, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert other.stdin is not None
    assert other.stdout is not None
    try:
        request, transfers = _REQUEST.pack(1, 1.0), 0
        other.stdin.write(request)  # it has begun when it answers
        request = other.stdout.read(_REQUEST.size) or request
        start = now = time.perf_counter()
        while now - start < seconds:
            other.stdin.write(work(request))
            request = other.stdout.read(_REQUEST.size) or request
            transfers += 1
            now = time.perf_counter()
    finally:
        other.stdin.close()
        other.wait()
        other.stdout.close()
    return transfers / (now - start)


def rate_hz(full: int, machine_speed: float) -> int:
    """Return the rate of a pod that this machine can bear where ``full`` is for one of speed 1."""
    wanted = _share(machine_speed) * full
    return max((rate for rate in RATES_HZ if rate <= wanted), default=RATES_HZ[-1])


def fps(full: int, machine_speed: float, least: int = 4) -> int:
    """Return the frame rate that this machine can bear where ``full`` is for one of speed 1."""
    return max(least, round(_share(machine_speed) * full))


def _share(machine_speed: float) -> float:
    return 1.0 if machine_speed >= FULL_LOAD else machine_speed


if __name__ == "__main__":
    while request_ := os.read(0, _REQUEST.size):
        os.write(1, work(request_))
