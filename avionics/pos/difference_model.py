"""Measurement rows of the methods Gs, As and GA: sensor differences between slave and master.

Gs and As of Gong et al. and their combination are one filter with different rows. Besides
[rho, theta, theta_dot] the state holds, where they are used, the biases of the four sensor triads
and the increments of theta and theta_dot over the last step. The increments are the clones
theta_(k-1), theta_dot_(k-1) of the specification in another basis: their variances are those of
one step, so that nothing cancels in H P H^T when the sensor noise is tiny.
"""

from typing import NamedTuple

import numpy as np

from avionics.pos.compiled import Array, IndexArray, compiled

RHO, THETA, RATE = 0, 3, 6  # first index of each triad that every variant has


class Layout(NamedTuple):
    """First index of each optional triad, or -1 where the filter has none."""

    gyro_bias_m: int
    gyro_bias_s: int
    force_bias_m: int
    force_bias_s: int
    d_theta: int
    d_rate: int


class Switches(NamedTuple):
    """What the compiled rows do; see ``difference_filter.DifferenceOptions``."""

    nonlinear: bool
    integrating: bool
    arm_in_H: bool
    arm_model: bool


def layout(*, gyros: bool, forces: bool, d_theta: bool, d_rate: bool) -> tuple[Layout, int]:
    """Return where the optional triads lie, and the number of states."""
    wanted = [gyros, gyros, forces, forces, d_theta, d_rate]
    first, places = 9, []
    for is_wanted in wanted:
        places.append(first if is_wanted else -1)
        first += 3 if is_wanted else 0
    return Layout(*places), first


@compiled
def put(H: Array, column: int, block: Array, scale: float) -> None:
    """Add ``scale * block`` to three columns of H; nothing where the column is -1."""
    if column >= 0:
        for i in range(3):
            for j in range(3):
                H[i, column + j] += scale * block[i, j]


@compiled
def put_identity(H: Array, column: int, scale: float) -> None:
    """Add ``scale * I`` to three columns of H; nothing where the column is -1."""
    if column >= 0:
        for i in range(3):
            H[i, column + i] += scale


@compiled
def linear_innovation(x: Array, slave: Array, master: Array, H: Array, y: Array) -> None:
    """Write slave - master - H x, shape (3,)."""
    for i in range(3):
        y[i] = slave[i] - master[i]
        for j in range(x.shape[0]):
            y[i] -= H[i, j] * x[j]


def transition(Phi: Array, Q_flex: Array, at: Layout, size: int) -> tuple[Array, Array]:
    """Return D = Phi - I and Q over a step, shapes (n, n).

    Parameters
    ----------
    Phi, Q_flex : ndarray, shape (3, 2, 2)
        Of the flexure, from ``flexure.discretise``.
    at, size : Layout, int
        The state.
    """
    D, Q = np.zeros((size, size)), np.zeros((size, size))
    for axis in range(3):
        pair = [THETA + axis, RATE + axis]
        change = Phi[axis] - np.eye(2)
        D[np.ix_(pair, pair)] = change
        rows, sources = list(pair), [0, 1]
        for place, source in ((at.d_theta, 0), (at.d_rate, 1)):
            if place >= 0:
                D[place + axis, pair] = change[source]
                D[place + axis, place + axis] = -1.0
                rows.append(place + axis)
                sources.append(source)
        Q[np.ix_(rows, rows)] = Q_flex[axis][np.ix_(sources, sources)]
    return D, Q


def pattern_of(D: Array) -> IndexArray:
    """Return the indices of the non-zero elements, shape (nnz, 2)."""
    return np.argwhere(D != 0.0).astype(np.int64)
