"""One bending and one twist mode, the paper's form, in Python's own numbers.

For the few pods of a wing this is several times faster than array calls.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class PodWeights(NamedTuple):
    """One live pod: where it stands in the rates, its mode shapes, its weights in Eq. 7."""

    at: int
    phi_shape: float
    theta_shape: float
    to_phi: float
    to_theta: float


def modal_rates(
    phi: float, theta: float, turns: Sequence[float], pods: Sequence[PodWeights]
) -> tuple[float, float]:
    """Return the rates of both amplitudes: Eqs. 6 and 7 of Srikanth et al.

    Parameters
    ----------
    phi, theta : float
        Amplitudes, rad.
    turns : sequence of float
        Rates (P, Q, R) of pod after pod, rad/s.
    pods : sequence of PodWeights
        The live pods.
    """
    d_phi = d_theta = 0.0
    for at, phi_shape, theta_shape, to_phi, to_theta in pods:
        angle, pitch, yaw = phi * phi_shape, turns[at + 1], turns[at + 2]
        s_phi, c_phi = math.sin(angle), math.cos(angle)
        along = s_phi * pitch + c_phi * yaw
        d_phi += to_phi * (turns[at] + math.tan(theta * theta_shape) * along)
        d_theta += to_theta * (c_phi * pitch - s_phi * yaw)
    return d_phi, d_theta


def midpoint(x: Array, omega: Array, dt: float, pods: Sequence[PodWeights]) -> tuple[Array, Array]:
    """Return the state after a step by the midpoint rule, and the amplitudes at its middle.

    Parameters
    ----------
    x : ndarray, shape (2,) or (2 + 3M,)
        Amplitudes, and gyro biases where they are states.
    omega : ndarray, shape (M, 3)
        Rates of the pods at the middle of the step, rad/s.
    dt : float
        Length of the step, s.
    pods : sequence of PodWeights
        The live pods.
    """
    phi, theta, *biases = x.tolist()
    turns = omega.ravel().tolist()
    if biases:
        turns = [turn - bias for turn, bias in zip(turns, biases, strict=True)]
    d_phi, d_theta = modal_rates(phi, theta, turns, pods)
    half = 0.5 * dt
    phi_middle, theta_middle = phi + half * d_phi, theta + half * d_theta
    d_phi, d_theta = modal_rates(phi_middle, theta_middle, turns, pods)
    after = [phi + dt * d_phi, theta + dt * d_theta, *biases]
    return np.array(after), np.array([phi_middle, theta_middle])
