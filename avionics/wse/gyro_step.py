"""What the gyros measured between two instants, or at one: the input of the time update."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class Regime(NamedTuple):
    """What holds for a step of the grid and for every part of it.

    Attributes
    ----------
    live : tuple of bool, length M
        Which pods deliver.
    activity : ndarray, shape (3,)
        Recent mean square of the rates of a family's first amplitude (bending, twist, in-plane),
        (rad/s)^2.
    """

    live: tuple[bool, ...]
    activity: Array


class GyroStep(NamedTuple):
    """The gyros' rates between two instants; ``stacked`` gives every array a leading axis.

    Attributes
    ----------
    dt : float
        Length, s; shape (steps, 1) in a stack.
    rates : ndarray, shape (M, 3)
        Rates at the middle, local axes, rad/s; zero where the pod is silent.
    regime : Regime
        Live pods and activity.
    body : ndarray, shape (3,), or None
        Rate of the root at the middle, body axes, rad/s; None where it is not measured.
    """

    dt: Any
    rates: Array
    regime: Regime
    body: Array | None = None

    @property
    def live(self) -> tuple[bool, ...]:
        """Which pods deliver."""
        return self.regime.live

    @property
    def kind(self) -> tuple[tuple[bool, ...], bool]:
        """What steps have in common that can be stacked."""
        return self.regime.live, self.body is None


class Motion(NamedTuple):
    """How the amplitudes move at an exposure; needed where a frame shows another instant.

    Attributes
    ----------
    rate : ndarray, shape (n,)
        As the gyros measure it, rad/s.
    acceleration : ndarray, shape (n,)
        rad/s^2.
    live : tuple of bool
        Which pods delivered.
    """

    rate: Array
    acceleration: Array
    live: tuple[bool, ...] = ()


def stacked(steps: Sequence[GyroStep]) -> GyroStep:
    """Return steps of one kind as one, for batched calls: its arrays have the steps first."""
    first = steps[0]
    return GyroStep(
        np.array([[step.dt] for step in steps]),
        np.array([step.rates for step in steps]),
        Regime(first.live, np.array([step.regime.activity for step in steps])),
        None if first.body is None else np.array([step.body for step in steps]),
    )
