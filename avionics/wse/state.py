"""The state of a filter: which quantity stands where, how it begins, how it wanders."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from avionics.wse.modes import ModeBasis

Array = NDArray[Any]


class Estimate(NamedTuple):
    """The state of a filter at a known instant.

    Attributes
    ----------
    x : ndarray, shape (size,)
        State, as ``StateLayout`` orders it; (rows, size) in a stack.
    P : ndarray, shape (size, size)
        Its covariance.
    """

    x: Array
    P: Array


class RandomWalk(NamedTuple):
    """A slow quantity: its one-sigma at the start, and the density of its random walk per sqrt(s).

    Both in the unit of the quantity.
    """

    sigma: float
    walk: float = 0.0


class StateLayout:
    """Named slices of the state, with labels, variances at the start and random walks.

    The state is (amplitudes; gyro biases by pod and axis; unobserved modal rates; time offset of
    the camera), all but the first as wanted; a slice that is not wanted is empty. Whoever reads or
    writes a state asks here where it stands. A new one is a block here, its term in the model that
    it belongs to (``Process`` or ``MarkerUpdate``) and its key in the configuration.

    Parameters
    ----------
    basis : ModeBasis
        Mode shapes.
    pods : sequence of str
        Names of the pods.
    prior : ndarray, shape (basis.count,)
        Variances of the amplitudes at the start, rad^2.
    truncation : float
        Noise of every amplitude for the modes left out, rad/sqrt(s).
    bias : RandomWalk, optional
        Of every gyro axis, rad/s.
    has_unobserved : bool
        Whether the modal rates that the gyros leave unobserved are states.
    offset : RandomWalk, optional
        Of the camera's clock against the gyros', s.

    Attributes
    ----------
    amplitudes, phi, theta, psi : slice
        All amplitudes, and those of bending, twist and in-plane bending.
    bias, unobserved, offset : slice
        The other states.
    logged : slice
        Amplitudes and biases: what a record's covariance holds. Slow states of the camera and
        unobserved rates stay inside.
    labels : tuple of str
        Name of every state, e.g. ``phi 1`` or ``bias 0 x``.
    size : int
        Length of the state.
    start_P : ndarray, shape (size, size)
        Covariance before anything is known.
    walk : ndarray, shape (size,)
        Variance that each state gains in a second from its own wandering.
    """

    def __init__(
        self,
        basis: ModeBasis,
        pods: Sequence[str],
        *,
        prior: Array,
        truncation: float = 0.0,
        bias: RandomWalk | None = None,
        has_unobserved: bool = False,
        offset: RandomWalk | None = None,
    ) -> None:
        self.basis = basis
        self.phi, self.theta, self.psi = basis.phi, basis.theta, basis.psi
        self.labels: tuple[str, ...] = ()
        self._variances: list[float] = []
        self._walks: list[float] = []
        modes = basis.labels
        axes = [f"bias {pod} {axis}" for pod in pods for axis in "xyz"]
        self.amplitudes = self._block(modes, prior, truncation)
        self.bias = self._slow(axes, bias)
        self.logged = slice(0, self.bias.stop)
        rates = [f"{mode} unobserved rate" for mode in modes] if has_unobserved else []
        self.unobserved = self._block(rates, 0.0, 0.0)
        self.offset = self._slow(["time offset"], offset)
        self.size = len(self.labels)
        self.start_P: Array = np.diag(np.array(self._variances))
        self.walk = np.array(self._walks)

    def _block(self, labels: Sequence[str], variance: float | Array, walk: float) -> slice:
        start = len(self.labels)
        self.labels += tuple(labels)
        self._variances += np.broadcast_to(variance, len(labels)).tolist()
        self._walks += [walk**2] * len(labels)
        return slice(start, len(self.labels))

    def _slow(self, labels: Sequence[str], walk: RandomWalk | None) -> slice:
        if walk is None:
            return self._block((), 0.0, 0.0)
        return self._block(labels, walk.sigma**2, walk.walk)

    @property
    def has_bias(self) -> bool:
        """Whether gyro biases are states."""
        return bool(self.bias.stop > self.bias.start)

    @property
    def has_unobserved(self) -> bool:
        """Whether unobserved modal rates are states."""
        return bool(self.unobserved.stop > self.unobserved.start)

    @property
    def has_offset(self) -> bool:
        """Whether the camera's time offset is a state."""
        return bool(self.offset.stop > self.offset.start)
