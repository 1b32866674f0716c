"""The one clock: int64 nanoseconds, monotonic, of this machine or of a simulation."""

import time
from pathlib import Path
from typing import Final, Protocol

BOOT_ID: Final = Path("/proc/sys/kernel/random/boot_id")
# A stamp older than this when it is read means that CLOCK_REALTIME stepped in between.
OLDEST_STAMP_NS: Final = 5_000_000_000


class Clock(Protocol):
    """A monotonic clock in nanoseconds."""

    def now_ns(self) -> int:
        """Return the present time, ns."""
        ...

    def sleep_until_ns(self, t_ns: int) -> None:
        """Return when the clock has reached ``t_ns``; at once if it already has."""
        ...


class SteadyClock:
    """``CLOCK_MONOTONIC`` of this machine."""

    def now_ns(self) -> int:
        """Return the present time, ns."""
        return time.monotonic_ns()

    def sleep_until_ns(self, t_ns: int) -> None:
        """Sleep until the clock reads ``t_ns``."""
        remaining_ns = t_ns - time.monotonic_ns()
        if remaining_ns > 0:
            time.sleep(remaining_ns * 1e-9)


def utc_offset_ns(pairs: int = 9) -> int:
    """Return UTC minus steady time, ns, from the tightest of several paired readings.

    Parameters
    ----------
    pairs : int
        Number of readings; the one whose two steady readings lie closest is taken.
    """
    best_width_ns, best_offset_ns = 1 << 62, 0
    for _ in range(pairs):
        before_ns = time.monotonic_ns()
        utc_ns = time.time_ns()
        after_ns = time.monotonic_ns()
        if after_ns - before_ns < best_width_ns:
            best_width_ns = after_ns - before_ns
            best_offset_ns = utc_ns - (before_ns + after_ns) // 2
    return best_offset_ns


def boot_id() -> str:
    """Return what names this start of this machine: two steady clocks with one id are one clock.

    Empty where the system does not report it.
    """
    try:
        return BOOT_ID.read_text(encoding="ascii").strip()
    except OSError:
        return ""


def read_both_ns(clock: Clock, attempts: int = 4) -> tuple[int, int]:
    """Return a clock's time and CLOCK_REALTIME of one instant, ns, to some 10 us.

    Parameters
    ----------
    clock : Clock
        The steady clock.
    attempts : int
        How often the pair is read again when something came in between.
    """
    best, best_width_ns = (0, 0), 1 << 62
    for _ in range(attempts):
        before_ns = clock.now_ns()
        realtime_ns = time.time_ns()
        width_ns = clock.now_ns() - before_ns
        if width_ns < best_width_ns:
            best, best_width_ns = (before_ns + width_ns // 2, realtime_ns), width_ns
        if width_ns < 10_000:
            break
    return best


class SteadyStamps:
    """Turns kernel receive stamps (CLOCK_REALTIME) to the steady clock.

    Notes
    -----
    The age of a stamp is the present CLOCK_REALTIME minus the stamp, both on the same clock, and
    the steady time is the present minus that age. Only a step between reception and reading can
    spoil an age; it shows as a change of the offset between the clocks, and the offset known
    before the step is then tried.
    """

    def __init__(self) -> None:
        self.steps = 0
        self._offset_ns: int | None = None
        self._before_step_ns: int | None = None

    def convert(self, stamp_ns: int, steady_ns: int, realtime_ns: int) -> int:
        """Return the steady time of a stamp.

        Parameters
        ----------
        stamp_ns : int
            The kernel's stamp, CLOCK_REALTIME.
        steady_ns, realtime_ns : int
            Both clocks, read together after the stamp.
        """
        offset_ns = realtime_ns - steady_ns
        if self._offset_ns is not None and abs(offset_ns - self._offset_ns) > 5_000_000:
            self.steps += 1
            self._before_step_ns = self._offset_ns
        self._offset_ns = offset_ns
        candidates = [stamp_ns - offset_ns]
        if self._before_step_ns is not None:
            candidates.append(stamp_ns - self._before_step_ns)
        # The youngest that is not in the future: a frame is read soon after it came.
        fitting = [t for t in candidates if 0 <= steady_ns - t <= OLDEST_STAMP_NS]
        return max(fitting, default=steady_ns)
