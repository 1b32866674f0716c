"""RG-WSE: gyros alone, in the paper's form, one mode of each kind and no bias removed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.gyro_step import GyroStep
from avionics.wse.process import Process
from avionics.wse.state import Estimate

Array = NDArray[Any]

# The covariance of a drifting estimate changes slowly: it takes one long step in ten.
STEPS_PER_COVARIANCE = 10


class GyroIntegrator:
    """Integrates Eq. 7 of Srikanth et al. from a start shape on.

    The states behind the amplitudes are the gyro biases. They stay zero, as in the paper; their
    uncertainty makes the covariance that of a drifting estimate.

    Parameters
    ----------
    process : Process
        With bias states.
    t_ns : int
        Instant of the start, ns.
    keep : int
        Number of steps that a start shape may come late.
    """

    def __init__(self, process: Process, t_ns: int, *, keep: int) -> None:
        self._process = process
        self._amplitudes = process.layout.amplitudes
        self.x: Array = np.zeros(process.layout.size)
        self.P: Array = process.layout.start_P
        self._keep = keep
        self._times = [t_ns]
        self._steps: list[GyroStep] = []
        self._pending: list[tuple[GyroStep, Array]] = []
        self.is_started = False

    @property
    def t_ns(self) -> int:
        """Instant of the state, ns."""
        return self._times[-1]

    @property
    def estimate(self) -> Estimate:
        """The newest state, and a covariance that may be up to nine steps older."""
        return Estimate(self.x, self.P)

    def append(self, t_ns: int, step: GyroStep) -> None:
        """Step on to ``t_ns``."""
        self._advance(step)
        if self.is_started:
            self._times[-1] = t_ns
            return
        self._times.append(t_ns)
        self._steps.append(step)
        if len(self._steps) > self._keep:
            del self._times[0], self._steps[0]

    def _advance(self, step: GyroStep) -> None:
        self.x, middle = self._process.move(self.x, step)
        self._pending.append((step, middle))
        if len(self._pending) == STEPS_PER_COVARIANCE:
            whole = sum(step.dt for step, _ in self._pending)
            step, middle = self._pending[STEPS_PER_COVARIANCE // 2]
            long = step._replace(dt=whole)
            self.P = self._process.spread(self.P, self.x, [middle], [long])[-1]
            self._pending.clear()

    def start(self, t_ns: int, fit: Estimate) -> None:
        """Take the shape at ``t_ns`` as the start and repeat the steps since.

        Parameters
        ----------
        t_ns : int
            Instant of the shape, ns; the nearest remembered step is taken.
        fit : Estimate
            Least-squares fit of the amplitudes to the camera.
        """
        at = int(np.argmin([abs(t - t_ns) for t in self._times]))
        now_ns, q = self._times[-1], self._amplitudes
        self.P = self.P.copy()
        self.P[q, :] = 0.0
        self.P[:, q] = 0.0
        self.P[q, q] = fit.P
        self._pending.clear()
        self.x = np.zeros_like(self.x)
        self.x[q] = fit.x
        for step in self._steps[at:]:
            self._advance(step)
        self._times, self._steps = [now_ns], []
        self.is_started = True
