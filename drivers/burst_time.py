"""When a chip gave the data of a burst that only its host's clock has timed."""

from collections import deque
from typing import Final

# A burst so much longer than the shortest of the last ones was held up, before or after the chip
# gave its data. Half a period of 100 Hz: the gap that a lost sample leaves then costs less than a
# rate at a wrong time. What is held up for less is kept, wrong by a part of that.
SLOW_NS: Final = 5_000_000
DURATIONS: Final = 100


class BurstTime:
    """Time of the data within a burst, from how long the bursts before it took.

    Parameters
    ----------
    length : int
        Data bytes of a burst.
    address_bytes : int
        Bytes that go before them: the chip takes the data when they begin.
    """

    def __init__(self, length: int, address_bytes: int) -> None:
        self._length = length
        self._address_bytes = address_bytes
        self._durations_ns: deque[int] = deque(maxlen=DURATIONS)

    def taken_ns(self, before_ns: int, after_ns: int) -> tuple[int, bool]:
        """Return when the chip took the data that came between two instants.

        Returns
        -------
        taken_ns : int
            When the data began, after the bytes of addresses, ns.
        is_vague : bool
            Whether the burst was held up.
        """
        whole_ns = after_ns - before_ns
        self._durations_ns.append(whole_ns)
        taken_ns = before_ns + whole_ns * self._address_bytes // (
            self._address_bytes + self._length
        )
        return taken_ns, whole_ns - min(self._durations_ns) > SLOW_NS
