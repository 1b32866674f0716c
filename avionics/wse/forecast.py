"""What is known at some ticks, and the step ahead of the gyros that leads there."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from avionics.wse.gyro_step import GyroStep, stacked
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates

Array = NDArray[Any]


class Belief(NamedTuple):
    """State and covariance at one instant.

    Attributes
    ----------
    x : ndarray, shape (size,)
        Amplitudes, biases, time offset; (rows, size) in a stack.
    P : ndarray, shape (size, size)
        Its covariance.
    """

    x: Array
    P: Array


class Outlook(NamedTuple):
    """What is known at a tick, and the step ahead of the gyros that leads there.

    Attributes
    ----------
    rg, crg : Belief
        Of both estimators; the covariance may be older than the state.
    step : GyroStep or None
        From the states to the tick; None where they are the tick's already.
    since_s : float
        From the instant of the camera-aided covariance to the tick, s.
    scale : float
        Factor on the variance of the unseen rates.
    guess_error : ndarray, shape (M, 3)
        Mean square error of the turns guessed ahead of the gyros, rad^2.
    """

    rg: Belief
    crg: Belief
    step: GyroStep | None = None
    since_s: float = 0.0
    scale: float = 1.0
    guess_error: Array | None = None


class StepsAhead(NamedTuple):
    """Steps of one kind; the arrays have the steps first.

    Attributes
    ----------
    at : list of int
        Which ticks they lead to.
    step : GyroStep
        The steps, stacked.
    since_s, scale, guess_error : ndarray
        As in ``Outlook``.
    """

    at: list[int]
    step: GyroStep
    since_s: Array
    scale: Array
    guess_error: Array


class Outlooks(NamedTuple):
    """The outlooks of some ticks, stacked: few arrays, to be worked on here or elsewhere.

    Attributes
    ----------
    rg, crg : Belief
        Of both estimators.
    ahead : list of StepsAhead
        Steps that are still to be done.
    """

    rg: Belief
    crg: Belief
    ahead: list[StepsAhead]


def stack_outlooks(outlooks: Sequence[Outlook]) -> Outlooks:
    """Return some outlooks, at least one, as one."""
    alike: dict[object, list[int]] = {}
    for i, outlook in enumerate(outlooks):
        if outlook.step is not None:
            alike.setdefault(outlook.step.kind, []).append(i)
    return Outlooks(
        stack_beliefs([outlook.rg for outlook in outlooks]),
        stack_beliefs([outlook.crg for outlook in outlooks]),
        [_ahead(at, [outlooks[i] for i in at]) for at in alike.values()],
    )


def stack_beliefs(beliefs: Sequence[Belief]) -> Belief:
    """Return some beliefs as one."""
    return Belief(np.array([b.x for b in beliefs]), np.array([b.P for b in beliefs]))


def _ahead(at: list[int], outlooks: Sequence[Outlook]) -> StepsAhead:
    return StepsAhead(
        at,
        stacked([outlook.step for outlook in outlooks if outlook.step is not None]),
        np.array([outlook.since_s for outlook in outlooks]),
        np.array([outlook.scale for outlook in outlooks]),
        np.array([outlook.guess_error for outlook in outlooks]),
    )


class Extrapolation:
    """Goes the steps ahead of the gyros, for both estimators.

    Parameters
    ----------
    rates : ModalRates
        Gyro kinematics in the camera-aided filter's basis.
    process, paper_process : Process
        Time updates of the camera-aided filter and of RG-WSE.
    """

    def __init__(self, rates: ModalRates, process: Process, paper_process: Process) -> None:
        self._rates = rates
        self._process = process
        self._paper_process = paper_process
        self._diagonal = np.arange(rates.basis.count)

    def beliefs(self, outlooks: Outlooks) -> tuple[Belief, Belief]:
        """Return (RG-WSE, CRG-WSE) as flown at the ticks, stacked; one batched call for all."""
        (rg_x, rg_P), (x, P) = outlooks.rg, outlooks.crg
        for at, step, since_s, scale, error in outlooks.ahead:
            rg_x[at] = self._paper_process.move(rg_x[at], step)[0]
            x[at] = self._process.move(x[at], step)[0]
            drifted = self._process.drifted(P[at], since_s, step, scale)
            P[at] = self.widened(drifted, step, error)
        return Belief(rg_x, rg_P), Belief(x, P)

    def widened(self, P: Array, step: GyroStep, error: Array) -> Array:
        """Add to ``P``, in place, how wrong the turns guessed ahead of the gyros were so far."""
        inverse = self._rates.inverse(step.live)
        families = (inverse.phi, inverse.theta, inverse.psi)
        added = [error[..., axis] @ family**2 for axis, family in enumerate(families)]
        P[..., self._diagonal, self._diagonal] += np.concatenate(added, axis=-1)
        return P
