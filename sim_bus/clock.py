"""The stepped clock: time moves on command, and everything in simulated time moves with it."""

from collections.abc import Callable

Advance = Callable[[int], None]


class SimClock:
    """A ``drivers.clock.Clock`` that moves only when somebody advances it.

    Parameters
    ----------
    start_ns : int
        First reading, ns.

    Notes
    -----
    A call back may read the clock but not move it: a transfer that took simulated time would
    otherwise let the wing run ahead of the pods that are being stepped.
    """

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns
        self._listeners: list[Advance] = []
        self._is_moving = False

    def now_ns(self) -> int:
        """Return the present simulated time, ns."""
        return self._now_ns

    def sleep_until_ns(self, t_ns: int) -> None:
        """Move the clock to ``t_ns``; at once if it is there already."""
        if t_ns > self._now_ns:
            self.advance_to(t_ns)

    def on_advance(self, listener: Advance) -> None:
        """Call ``listener(now_ns)`` after every move of the clock, in order of registration."""
        self._listeners.append(listener)

    def advance_to(self, t_ns: int) -> None:
        """Move to ``t_ns`` and call every listener.

        Raises
        ------
        ValueError
            If ``t_ns`` lies in the past.
        RuntimeError
            If a listener moves the clock.
        """
        if t_ns < self._now_ns:
            msg = f"clock at {self._now_ns} ns cannot go back to {t_ns} ns"
            raise ValueError(msg)
        if self._is_moving:
            msg = "a listener of the simulated clock must not move it"
            raise RuntimeError(msg)
        self._now_ns = t_ns
        self._is_moving = True
        try:
            for listener in self._listeners:
                listener(t_ns)
        finally:
            self._is_moving = False

    def advance(self, step_ns: int) -> None:
        """Move on by ``step_ns``."""
        self.advance_to(self._now_ns + step_ns)
