"""Sources that block, side by side on a stepped clock.

On hardware every bus has its own thread, and a transfer of 4 ms on one does not hold up another. In
lockstep there is one thread: each polled source lives on a time line of its own, which its
transfers and waits move, and its samples come out when the rig's clock has got there.
"""

from collections import deque

from drivers.clock import Clock
from drivers.events import Event
from drivers.polled_imus import PolledImus
from drivers.samples import ImuSample


class Timeline:
    """The clock of one thread that does not exist: sleeping moves it, and nothing else."""

    def __init__(self, start_ns: int) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return how far this time line has got, ns."""
        return self._now_ns

    def sleep_until_ns(self, t_ns: int) -> None:
        """Move to ``t_ns``; at once if it is there already."""
        self._now_ns = max(self._now_ns, t_ns)


class ParallelImus:
    """A ``PolledImus`` as if it ran in its own thread; a ``Source[ImuSample]``.

    Parameters
    ----------
    source : PolledImus
        The source; its clock and its bus's clock are ``timeline``.
    timeline : Timeline
        Its own time.
    clock : Clock
        The rig's clock.
    """

    def __init__(self, source: PolledImus, timeline: Timeline, clock: Clock) -> None:
        self._source, self._timeline, self._clock = source, timeline, clock
        self._done: deque[tuple[int, ImuSample]] = deque()

    def open(self) -> None:
        """Bring every chip up, on the source's own time.

        Raises
        ------
        DriverError
            As ``PolledImus.open``.
        """
        self._source.open()

    def read(self, timeout_s: float) -> ImuSample | None:
        """Return the next sample, None if none is done within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while not self._done and (left_ns := deadline_ns - self._timeline.now_ns()) > 0:
            sample = self._source.read(left_ns * 1e-9)
            if sample is not None:
                self._done.append((self._timeline.now_ns(), sample))
        if not self._done or self._done[0][0] > deadline_ns:
            if timeout_s > 0:
                self._clock.sleep_until_ns(deadline_ns)
            return None
        done_ns, sample = self._done.popleft()
        self._clock.sleep_until_ns(done_ns)
        return sample

    @property
    def counters(self) -> dict[str, int]:
        """All counters of the source."""
        return self._source.counters

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source."""
        return self._source.health()

    def chip_ids(self) -> dict[str, bytes]:
        """Return the unique ids of the chips that are up."""
        return self._source.chip_ids()

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._source.take_events()

    def close(self) -> None:
        """Release the bus; may be called twice."""
        self._source.close()
