"""The pods' rates over time: interpolated, extrapolated, and cut into steps of the filter."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.rates import ModalRates

Array = NDArray[Any]

# The wing's activity is the mean square of its rates over this time.
ACTIVITY_S = 0.3
# Before any gyro has spoken: (0.1 rad/s)^2.
START_ACTIVITY = 0.01
SILENT = [0.0, 0.0, 0.0]
NOTHING_FOUND: tuple[int, tuple[bool, ...], Array] = (-1, (), np.empty((0, 3)))


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


class GyroInputs:
    """Rate tracks of all pods and of the root.

    Parameters
    ----------
    rates : ModalRates
        Knows the pods' stations.
    period_ns : int
        Their sample period, ns. A pod is waited for five periods, joined over three and a half.
    """

    def __init__(self, rates: ModalRates, period_ns: int) -> None:
        pods = rates.pods
        self._rates = rates
        gap_ns = 7 * period_ns // 2
        self._tracks = [RateTrack(gap_ns) for _ in range(pods)]
        self._root = RateTrack(gap_ns)
        self._hold_ns = gap_ns
        self._wait_ns = 5 * period_ns
        self._activity = np.full(3, START_ACTIVITY)
        self._found = NOTHING_FOUND

    def add(self, pod: int, t_ns: int, rate: Sequence[float]) -> bool:
        """Take a sample of a pod, local axes, rad/s; False unless it is newer than its last."""
        self._found = NOTHING_FOUND
        return self._tracks[pod].add(t_ns, rate)

    def add_root(self, t_ns: int, rate: Sequence[float]) -> bool:
        """Take a sample of the root's rate, body axes, rad/s."""
        return self._root.add(t_ns, rate)

    def forget(self, before_ns: int) -> None:
        """Drop what no step after ``before_ns`` needs."""
        for track in (*self._tracks, self._root):
            track.forget(before_ns)

    def first_known_ns(self, now_ns: int) -> int | None:
        """Return when every pod had begun, or those that have after a wait; None before."""
        if not self._tracks:
            return now_ns
        firsts = [track.oldest_ns for track in self._tracks if track.oldest_ns is not None]
        if len(firsts) == len(self._tracks):
            return max(firsts)
        if firsts and now_ns - min(firsts) > 2 * self._wait_ns:
            return max(firsts)
        return None

    def known_until(self, now_ns: int) -> int:
        """Return until when every pod that still delivers is known, ns."""
        floor = now_ns - self._wait_ns
        latest = [track.latest_ns for track in self._tracks]
        live = [t for t in latest if t is not None and t >= floor]
        return min(live) if live else floor

    def regime(self, a_ns: int, b_ns: int) -> Regime:
        """Return which pods deliver without a gap, and how active the wing is; call in order."""
        live = tuple(track.covers(a_ns, b_ns) for track in self._tracks)
        middle = (a_ns + b_ns) // 2
        now = self._rates.activity(self._at(middle, live), live)
        if now is not None:
            weight = min((b_ns - a_ns) * 1e-9 / ACTIVITY_S, 1.0)
            self._activity = self._activity + weight * (now - self._activity)
        return Regime(live, self._activity)

    def _at(self, t_ns: int, live: tuple[bool, ...]) -> Array:
        """Return the rates at an instant; the middle of a new grid step is asked for twice."""
        if self._found[:2] != (t_ns, live):
            rates = [
                track.at(t_ns) if is_live else SILENT
                for track, is_live in zip(self._tracks, live, strict=True)
            ]
            self._found = (t_ns, live, np.array(rates).reshape(-1, 3))
        return self._found[2]

    def _body(self, a_ns: int, b_ns: int) -> Array | None:
        newest = self._root.latest_ns
        if newest is None or b_ns - newest > self._wait_ns:
            return None
        return np.array(self._root.mean(a_ns, b_ns))

    def step(self, a_ns: int, b_ns: int, regime: Regime) -> GyroStep:
        """Return the rates at the middle of a step inside what is known."""
        rates = self._at((a_ns + b_ns) // 2, regime.live)
        return GyroStep((b_ns - a_ns) * 1e-9, rates, regime, self._body(a_ns, b_ns))

    def ahead(self, a_ns: int, b_ns: int) -> GyroStep:
        """Return the mean rates of a step that reaches beyond the newest samples."""
        rates = []
        live = []
        for track in self._tracks:
            newest = track.latest_ns
            live.append(newest is not None and b_ns - newest <= self._hold_ns)
            rates.append(track.mean(a_ns, b_ns) if live[-1] else SILENT)
        regime = Regime(tuple(live), self._activity)
        whole = np.array(rates).reshape(-1, 3)
        return GyroStep((b_ns - a_ns) * 1e-9, whole, regime, self._body(a_ns, b_ns))
