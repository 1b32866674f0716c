"""The pods' rates as steps of the filter: who is live, and how far all are known."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.gyro_rates import RateTrack
from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.rates import ModalRates

Array = NDArray[Any]

# The wing's activity is the mean square of its rates over this time.
ACTIVITY_S = 0.3
# Before any gyro has spoken: (0.1 rad/s)^2.
START_ACTIVITY = 0.01
SILENT = [0.0, 0.0, 0.0]
NOTHING_FOUND: tuple[int, tuple[bool, ...], Array] = (-1, (), np.empty((0, 3)))


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
