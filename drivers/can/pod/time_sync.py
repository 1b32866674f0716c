"""Pod time: offset and drift of every pod's clock against the steady clock of this machine.

The master sends ``Sync``, learns when it left, and sends that in ``FollowUp`` (for the pods' own
synchronised time). A pod answers ``SyncReply`` with its clock at the reception. From these pairs
``PodClock`` maps pod stamps to steady time; until the first pair it goes by the earliest arrivals.
"""

from collections import Counter, deque

import numpy as np
from numpy.typing import NDArray

WINDOW = 40
# Below this, arrival scatter says nothing about the clock; outliers are cut above it.
MIN_SPREAD_NS = 20_000.0
MAX_DRIFT = 500e-6
EARLY = 0.1
RESTART_NS = 50_000_000
# A stamp further than this before its frame's arrival, or after it, is not used.
OLDEST_NS, NEWEST_NS = 2_000_000_000, 20_000_000


def unwrap(value: int, bits: int, expected: int) -> int:
    """Return the number congruent to ``value`` modulo ``2**bits`` that is nearest ``expected``."""
    period = 1 << bits
    return expected + (value - expected + period // 2) % period - period // 2


class PodClock:
    """Maps one pod's microsecond stamps to the steady clock.

    Attributes
    ----------
    counters : Counter of str
        ``sync_pairs``, ``sync_outliers``, ``clock_restarts``, ``stamp_implausible``.
    """

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self._pairs: deque[tuple[int, int]] = deque(maxlen=WINDOW)
        self._suspect: tuple[int, int] | None = None
        self._is_anchored = False
        self._local_us, self._steady_ns = 0, 0
        self._rate = 1000.0

    @property
    def is_synchronised(self) -> bool:
        """Whether the mapping rests on sync pairs."""
        return bool(self._pairs)

    @property
    def drift(self) -> float:
        """How much faster than the steady clock the pod's runs; 1e-6 is one ppm."""
        return 1000.0 / self._rate - 1.0

    def add_pair(self, t_local_us: int, t_steady_ns: int) -> None:
        """Take one pair: the pod's clock (modulo 2^32 us) and the steady clock at one sync."""
        self.counters["sync_pairs"] += 1
        if not self._pairs:
            self._start(t_local_us, t_steady_ns)
            return
        local_us = unwrap(t_local_us, 32, self._to_local(t_steady_ns))
        if abs(self._to_steady(local_us) - t_steady_ns) > RESTART_NS:
            self._suspect_restart(t_local_us, t_steady_ns)
            return
        self._suspect = None
        self._pairs.append((local_us, t_steady_ns))
        self._fit()

    def sample_time_ns(self, t_local_us: int, arrival_ns: int) -> int:
        """Return the steady time of a stamp.

        Parameters
        ----------
        t_local_us : int
            The pod's clock, modulo 2^24 us.
        arrival_ns : int
            When the frame arrived; decides the rollover and whether the stamp is used.
        """
        if not self._is_anchored:
            self._anchor(t_local_us, arrival_ns)
        local_us = unwrap(t_local_us, 24, self._to_local(arrival_ns))
        t_ns = self._to_steady(local_us)
        if not self._pairs:
            # No transfer takes negative time: the earliest arrival is the best offset.
            if t_ns > arrival_ns or arrival_ns - t_ns > RESTART_NS:
                self._anchor(local_us, arrival_ns)
                t_ns = arrival_ns
        elif not arrival_ns - OLDEST_NS <= t_ns <= arrival_ns + NEWEST_NS:
            self.counters["stamp_implausible"] += 1
            t_ns = arrival_ns
        return t_ns

    def _anchor(self, local_us: int, steady_ns: int) -> None:
        self._is_anchored = True
        self._local_us, self._steady_ns = local_us, steady_ns

    def _start(self, local_us: int, steady_ns: int) -> None:
        self._pairs.clear()
        self._suspect = None
        self._rate = 1000.0
        self._anchor(local_us, steady_ns)
        self._pairs.append((local_us, steady_ns))

    def _suspect_restart(self, t_local_us: int, t_steady_ns: int) -> None:
        """Two pairs in a row that agree with each other but not with the past: a restart."""
        last, self._suspect = self._suspect, (t_local_us, t_steady_ns)
        self.counters["sync_outliers"] += 1
        if last is None:
            return
        elapsed_ns = t_steady_ns - last[1]
        if abs((t_local_us - last[0]) * 1000 - elapsed_ns) < MAX_DRIFT * elapsed_ns + 5e6:
            self.counters["clock_restarts"] += 1
            self._start(t_local_us, t_steady_ns)

    def _to_local(self, steady_ns: int) -> int:
        return self._local_us + round((steady_ns - self._steady_ns) / self._rate)

    def _to_steady(self, local_us: int) -> int:
        return self._steady_ns + round((local_us - self._local_us) * self._rate)

    def _fit(self) -> None:
        """Fit a line to the pairs; those that a busy machine delayed are left out."""
        local_0, steady_0 = self._pairs[-1]
        local = np.array([pair[0] - local_0 for pair in self._pairs], dtype=np.float64)
        steady = np.array([pair[1] - steady_0 for pair in self._pairs], dtype=np.float64)
        keep = np.ones(len(local), dtype=np.bool_)
        rate, offset = self._line(local, steady)
        for _ in range(2):
            residual = rate * local + offset - steady
            centre = np.median(residual[keep])
            spread = max(1.4826 * np.median(np.abs(residual[keep] - centre)), MIN_SPREAD_NS)
            keep = np.abs(residual - centre) <= 3 * spread
            rate, offset = self._line(local[keep], steady[keep])
        if not keep[-1]:
            self.counters["sync_outliers"] += 1
        # A pod can stamp a sync late but never early: the earliest ones are right.
        offset -= float(np.quantile((rate * local + offset - steady)[keep], EARLY))
        self._rate = rate
        self._local_us, self._steady_ns = local_0, steady_0 + round(offset)

    @staticmethod
    def _line(local: NDArray[np.float64], steady: NDArray[np.float64]) -> tuple[float, float]:
        """Return ns per us and ns at zero; the rate stays 1000 until the span carries one."""
        centre = local.mean()
        span = local - centre
        power = float(span @ span)
        # Half a second of pairs decides the drift of a quartz to some 100 ppm.
        if len(local) < 4 or np.ptp(local) < 5e5 or power == 0.0:
            return 1000.0, float((steady - 1000.0 * local).mean())
        rate = float(span @ steady) / power
        rate = float(np.clip(rate, 1000.0 / (1 + MAX_DRIFT), 1000.0 * (1 + MAX_DRIFT)))
        return rate, float((steady - rate * local).mean())


class SyncMaster:
    """Numbers the syncs and remembers when each left.

    Parameters
    ----------
    keep : int
        How many syncs are remembered for late replies.
    """

    def __init__(self, keep: int = 16) -> None:
        self._sent: dict[int, int] = {}
        self._keep = keep
        self._seq = -1

    def next_seq(self) -> int:
        """Return the number of the sync to send now."""
        self._seq = (self._seq + 1) % 256
        self._sent.pop(self._seq, None)
        return self._seq

    def left(self, seq: int, t_ns: int) -> None:
        """Remember that sync ``seq`` left at ``t_ns``."""
        self._sent[seq] = t_ns
        while len(self._sent) > self._keep:
            self._sent.pop(next(iter(self._sent)))

    def sent_ns(self, seq: int) -> int | None:
        """Return when sync ``seq`` left, None if that is not known."""
        return self._sent.get(seq)
