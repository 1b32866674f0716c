"""The simulated wing at the pace of the wall clock, for live runs and the bench."""

import threading

from drivers.clock import SteadyClock
from sim_bus.clock import Advance

TICK_NS = 1_000_000


class PacedClock:
    """The steady clock of this machine; its own thread steps whatever lives in simulated time.

    A listener that fails stops the ticking; ``close`` raises what it raised.
    """

    def __init__(self) -> None:
        self._steady = SteadyClock()
        self._listeners: list[Advance] = []
        self._stop = threading.Event()
        self._failure: Exception | None = None
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._tick, name="sim-clock", daemon=True)
        self._thread.start()

    def now_ns(self) -> int:
        """Return the present time, ns."""
        return self._steady.now_ns()

    def sleep_until_ns(self, t_ns: int) -> None:
        """Sleep until the clock reads ``t_ns``."""
        self._steady.sleep_until_ns(t_ns)

    def on_advance(self, listener: Advance) -> None:
        """Call ``listener(now_ns)`` about a thousand times a second, from the clock's thread."""
        with self._lock:
            self._listeners.append(listener)

    def close(self) -> None:
        """Stop the ticking; may be called twice."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def _tick(self) -> None:
        while not self._stop.is_set():
            self._steady.sleep_until_ns(self._steady.now_ns() + TICK_NS)
            try:
                with self._lock:
                    for listener in self._listeners:
                        listener(self._steady.now_ns())
            except Exception as error:  # noqa: BLE001 - handed to whoever closes the clock
                self._failure = error
                return
