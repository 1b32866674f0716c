"""Rate samples of the pods as functions of time: interpolated, extrapolated, averaged."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise


class RateTrack:
    """The recent samples of one pod, piecewise linear in time.

    Parameters
    ----------
    max_gap_ns : int
        Samples farther apart than this are not joined.
    """

    def __init__(self, max_gap_ns: int) -> None:
        self._max_gap_ns = max_gap_ns
        self._t: list[int] = []
        # Three numbers are several times quicker as Python's own than as an array.
        self._rate: list[Sequence[float]] = []

    @property
    def latest_ns(self) -> int | None:
        """Time of the newest sample, ns; None before the first."""
        return self._t[-1] if self._t else None

    @property
    def oldest_ns(self) -> int | None:
        """Time of the oldest sample kept, ns; None before the first."""
        return self._t[0] if self._t else None

    def add(self, t_ns: int, rate: Sequence[float]) -> bool:
        """Take a sample; False, and nothing is taken, unless it is newer than the last one."""
        if self._t and t_ns <= self._t[-1]:
            return False
        self._t.append(t_ns)
        self._rate.append(rate)
        return True

    def forget(self, before_ns: int) -> None:
        """Drop what is not needed to interpolate from ``before_ns`` on."""
        cut = bisect_right(self._t, before_ns) - 1
        if cut > 64:
            del self._t[:cut], self._rate[:cut]

    def covers(self, a_ns: int, b_ns: int) -> bool:
        """Return whether samples without a gap reach from ``a_ns`` to ``b_ns``."""
        first = bisect_right(self._t, a_ns) - 1
        if first < 0 or self._t[-1] < b_ns:
            return False
        for i in range(first, len(self._t) - 1):
            if self._t[i + 1] - self._t[i] > self._max_gap_ns:
                return False
            if self._t[i + 1] >= b_ns:
                break
        return True

    def at(self, t_ns: int) -> Sequence[float]:
        """Return the rate (P, Q, R) at ``t_ns``, rad/s.

        Linear between samples and beyond the newest, constant before the oldest and across gaps.
        """
        t = self._t
        i = bisect_right(t, t_ns)
        if i == 0 or len(t) == 1:
            return self._rate[max(i - 1, 0)]
        i = min(i, len(t) - 1)
        span = t[i] - t[i - 1]
        if span > self._max_gap_ns:
            return self._rate[i if t_ns >= t[i] else i - 1]
        weight = (t_ns - t[i - 1]) / span
        (p, q, r), (p_after, q_after, r_after) = self._rate[i - 1], self._rate[i]
        return [p + weight * (p_after - p), q + weight * (q_after - q), r + weight * (r_after - r)]

    def mean(self, a_ns: int, b_ns: int) -> Sequence[float]:
        """Return the mean rate (P, Q, R) from ``a_ns`` to ``b_ns``, rad/s."""
        if b_ns <= a_ns:
            return self.at(b_ns)
        i, j = bisect_right(self._t, a_ns), bisect_left(self._t, b_ns)
        if i >= j:
            return self.at((a_ns + b_ns) // 2)
        edges = [a_ns, *self._t[i:j], b_ns]
        total = [0.0, 0.0, 0.0]
        for left, right in pairwise(edges):
            rate = self.at((left + right) // 2)
            total = [sum_ + (right - left) * axis for sum_, axis in zip(total, rate, strict=True)]
        return [axis / (b_ns - a_ns) for axis in total]
