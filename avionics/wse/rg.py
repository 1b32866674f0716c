"""RG-WSE: gyros alone, in the paper's form, one mode of each kind and no bias removed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.gyro_step import GyroStep
from avionics.wse.process import Process

Array = NDArray[Any]

# The covariance of a drifting estimate changes slowly: one long step of it in ten.
STRETCH = 10


class StandaloneEstimate:
    """Integrates Eq. 7 of Srikanth et al. from a start shape on.

    The states behind the amplitudes are the gyro biases. They stay zero, as in the paper; their
    uncertainty makes the covariance that of a drifting estimate.

    Parameters
    ----------
    process : Process
        With bias states.
    q, P : ndarray, shapes (n,), (size, size)
        Start.
    t_ns : int
        Instant of the start.
    keep : int
        Number of steps that a start shape may come late.
    """

    def __init__(self, process: Process, q: Array, P: Array, t_ns: int, *, keep: int) -> None:
        self._process = process
        self._n = len(q)
        self.x = np.zeros(process.size)
        self.x[: self._n] = q
        self.P = P
        self._keep = keep
        self._times = [t_ns]
        self._states = [self.x]
        self._steps: list[GyroStep] = []
        self._pending: list[tuple[GyroStep, Array]] = []
        self.is_started = False

    @property
    def t_ns(self) -> int:
        """Instant of the state, ns."""
        return self._times[-1]

    def append(self, t_ns: int, step: GyroStep) -> None:
        """Step on to ``t_ns``."""
        self._advance(step)
        if self.is_started:
            self._times[-1] = t_ns
            return
        self._times.append(t_ns)
        self._states.append(self.x)
        self._steps.append(step)
        if len(self._steps) > self._keep:
            del self._times[0], self._states[0], self._steps[0]

    def _advance(self, step: GyroStep) -> None:
        self.x, middle = self._process.move(self.x, step)
        self._pending.append((step, middle))
        if len(self._pending) == STRETCH:
            whole = sum(step.dt for step, _ in self._pending)
            step, middle = self._pending[STRETCH // 2]
            long = step._replace(dt=whole)
            self.P = self._process.spread(self.P, self.x, [middle], [long])[-1]
            self._pending.clear()

    def start(self, t_ns: int, q: Array, P: Array) -> None:
        """Take the shape at ``t_ns`` as the start and repeat the steps since.

        Parameters
        ----------
        t_ns : int
            When the shape was this; the nearest remembered step is taken.
        q, P : ndarray, shapes (n,), (n, n)
            Least-squares fit to the camera, and its covariance.
        """
        at = int(np.argmin([abs(t - t_ns) for t in self._times]))
        now_ns = self._times[-1]
        self.P = self.P.copy()
        self.P[: self._n, :] = 0.0
        self.P[:, : self._n] = 0.0
        self.P[: self._n, : self._n] = P
        self._pending.clear()
        self.x = np.zeros_like(self.x)
        self.x[: self._n] = q
        for step in self._steps[at:]:
            self._advance(step)
        self._times, self._states, self._steps = [now_ns], [self.x], []
        self.is_started = True
