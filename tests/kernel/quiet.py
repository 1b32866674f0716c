"""How much of a CPU a process truly gets: on an oversubscribed machine no second means much."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

# A guest that gets less has stalls that its share does not show.
QUIET = 0.9


def cpu_share(seconds: float = 1.5) -> float:
    """Return the part of a CPU that a spinning process gets here, 0 to 1.

    Equal slices of work far shorter than a scheduler's time slice: most are not disturbed, and
    their median tells how long one takes then; all of them tell how long it took.
    """
    slices: list[float] = []
    start = last = time.perf_counter()
    while last - start < seconds:
        for _ in range(5000):
            pass
        now = time.perf_counter()
        slices.append(now - last)
        last = now
    undisturbed = sorted(slices)[len(slices) // 2]
    return min(1.0, undisturbed * len(slices) / (last - start))


class CpuWatch:
    """The share of a CPU that a test's processes could have, measured before and after its block.

    Parameters
    ----------
    processes : int
        How many want a CPU at once; no more are tried than there are CPUs.

    Attributes
    ----------
    share : float
        The least of all, 0 to 1.
    """

    def __init__(self, processes: int = 1) -> None:
        self.share = 1.0
        self._others = min(processes, os.cpu_count() or 1) - 1

    def __enter__(self) -> "CpuWatch":
        self._measure()
        return self

    def __exit__(self, *exc: object) -> None:
        self._measure()

    @property
    def is_short(self) -> bool:
        """Whether the machine was too busy to judge what needs its time."""
        return self.share < QUIET

    def _measure(self) -> None:
        spinner = [sys.executable, str(Path(__file__))]
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        others = [subprocess.Popen(spinner, **pipes) for _ in range(self._others)]
        for other in others:
            other.stdout.readline()
        # All at once: what shares a core with another is slower than what is alone on it.
        for other in others:
            other.stdin.write("\n")
            other.stdin.flush()
        shares = [cpu_share(), *(float(other.communicate()[0]) for other in others)]
        self.share = min(self.share, *shares)


if __name__ == "__main__":
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.readline()
    sys.stdout.write(str(cpu_share()))
