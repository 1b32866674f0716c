"""Method Gs step by step, for all pods of a wing at once: what flies beside the camera filter.

The same filter as ``difference_filter`` with integrating gyros and the exact measurement, in
plain arrays over the pods: no compiler, no history, one call per step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from avionics.pos.attitude import (
    right_jacobian,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)
from avionics.pos.compiled import Array
from avionics.pos.difference_model import RATE, RHO, THETA, layout, transition
from avionics.pos.flexure import Flexure, discretise

AT, SIZE = layout(gyros=True, forces=False, d_theta=True, d_rate=False)
BIAS_M, BIAS_S, STEP = AT.gyro_bias_m, AT.gyro_bias_s, AT.d_theta


@dataclass(frozen=True, slots=True)
class GyroNoise:
    """What the filter assumes of the gyros: rad/s, one-sigma.

    Attributes
    ----------
    noise_m, noise_s : float
        White noise of the mean rate over a step, master and slave.
    bias_m, bias_s : float
        Constants.
    bias_walk : float
        Random walk of the slaves' constants, rad/s per sqrt(s).
    """

    noise_m: float
    noise_s: float
    bias_m: float
    bias_s: float
    bias_walk: float = 0.0


class GsBank:
    """One Gs filter per pod, stepped together.

    Parameters
    ----------
    pods : int
        M.
    dt : float
        Step, s.
    flexure : Flexure
        Three axes, the same law for every pod.
    gyros : GyroNoise
        Noises.
    rho_sigma : float
        Initial one-sigma of the misalignment, rad.
    """

    def __init__(
        self, pods: int, dt: float, flexure: Flexure, gyros: GyroNoise, rho_sigma: float
    ) -> None:
        D, Q = transition(*discretise(flexure, dt), AT, SIZE)
        self._dt = dt
        self._Phi = np.eye(SIZE) + D
        self._Q = Q
        self._Q[range(BIAS_S, BIAS_S + 3), range(BIAS_S, BIAS_S + 3)] += gyros.bias_walk**2 * dt
        self._R = np.eye(3) * (gyros.noise_m**2 + gyros.noise_s**2)
        variance = np.zeros(SIZE)
        variance[RHO:THETA] = rho_sigma**2
        variance[THETA:RATE] = flexure.sigma**2
        variance[RATE : RATE + 3] = flexure.rate_sigma**2
        variance[BIAS_M : BIAS_M + 3] = gyros.bias_m**2
        variance[BIAS_S : BIAS_S + 3] = gyros.bias_s**2
        self.x = np.zeros((pods, SIZE))
        self.P = np.tile(np.diag(variance), (pods, 1, 1))

    def step(self, rate_m: Array, rate_s: Array, delivered: NDArray[np.bool_]) -> None:
        """Advance by one step.

        Parameters
        ----------
        rate_m : ndarray, shape (3,)
            The master's mean rate over the step, rad/s.
        rate_s : ndarray, shape (M, 3)
            The slaves'.
        delivered : ndarray of bool, shape (M,)
            Which slaves delivered; the others are only propagated.
        """
        self.coast()
        if delivered.any():
            self._update(rate_m, rate_s[delivered], delivered)

    def coast(self) -> None:
        """Advance by one step of which the master's motion is not known: nothing is measured."""
        self.x = self.x @ self._Phi.T
        self.P = self._Phi @ self.P @ self._Phi.T + self._Q

    def _update(self, rate_m: Array, rate_s: Array, delivered: NDArray[np.bool_]) -> None:
        x, P, dt = self.x[delivered], self.P[delivered], self._dt
        predicted, H = _increment(x, rate_m, dt)
        innovation = rate_s - predicted - x[:, BIAS_S : BIAS_S + 3]
        HP = H @ P
        R = self._R + _left_out(x, P, dt)
        gain = np.linalg.solve(HP @ np.swapaxes(H, -1, -2) + R, HP)
        K = np.swapaxes(gain, -1, -2)
        rest = np.eye(SIZE) - K @ H
        self.x[delivered] = x + np.einsum("mij,mj->mi", K, innovation)
        P = rest @ P @ np.swapaxes(rest, -1, -2) + K @ R @ gain
        self.P[delivered] = 0.5 * (P + np.swapaxes(P, -1, -2))

    def ahead(self, steps: int) -> tuple[Array, Array]:
        """Return angle, rad, (M, 3), and covariance, rad^2, (M, 3, 3), some steps from now."""
        x, P = self.x, self.P
        for _ in range(steps):
            x = x @ self._Phi.T
            P = self._Phi @ P @ self._Phi.T + self._Q
        return x[:, RHO:THETA] + x[:, THETA:RATE], _angle_block(P)

    @property
    def angle(self) -> Array:
        """System error angle u = rho + theta of every pod, rad, shape (M, 3)."""
        result: Array = self.x[:, RHO:THETA] + self.x[:, THETA:RATE]
        return result

    @property
    def angle_covariance(self) -> Array:
        """Covariance of u, rad^2, shape (M, 3, 3)."""
        return _angle_block(self.P)

    @property
    def bias(self) -> tuple[Array, Array]:
        """The slaves' biases and one-sigmas, rad/s, shapes (M, 3)."""
        variance = np.einsum("mii->mi", self.P[:, BIAS_S : BIAS_S + 3, BIAS_S : BIAS_S + 3])
        return self.x[:, BIAS_S : BIAS_S + 3], np.sqrt(variance)


def _increment(x: Array, rate_m: Array, dt: float) -> tuple[Array, Array]:
    """Predicted mean rate of the slaves, (M, 3), and its derivatives, (M, 3, n)."""
    u = x[:, RHO:THETA] + x[:, THETA:RATE]
    step = x[:, STEP : STEP + 3]
    w = rate_m - x[:, BIAS_M : BIAS_M + 3]
    before = np.swapaxes(rotation_from_vector(u - step), -1, -2)
    turned = before @ rotation_from_vector(w * dt) @ rotation_from_vector(u)
    middle = u - 0.5 * step
    D = np.swapaxes(rotation_from_vector(middle), -1, -2)
    J = right_jacobian(middle)
    by_angle = skew(np.einsum("mij,mj->mi", D, w)) @ J
    H = np.zeros((len(x), 3, SIZE))
    H[:, :, RHO:THETA] = H[:, :, THETA:RATE] = by_angle
    H[:, :, BIAS_M : BIAS_M + 3] = -D
    H[:, :, BIAS_S : BIAS_S + 3] = np.eye(3)
    H[:, :, STEP : STEP + 3] = J / dt - 0.5 * by_angle
    return vector_from_rotation(turned) / dt, H


def _angle_block(P: Array) -> Array:
    result: Array = (
        P[:, RHO:THETA, RHO:THETA]
        + P[:, RHO:THETA, THETA:RATE]
        + P[:, THETA:RATE, RHO:THETA]
        + P[:, THETA:RATE, THETA:RATE]
    )
    return result


def _left_out(x: Array, P: Array, dt: float) -> Array:
    """Noise that stands for du x theta_dot / 2, (M, 3, 3) diagonal; see ``second_order``."""
    step = x[:, STEP : STEP + 3]
    B = P[:, STEP : STEP + 3, STEP : STEP + 3] + step[:, :, None] * step[:, None, :]
    A = _angle_block(P)
    variance = np.stack(
        [
            A[:, j, j] * B[:, k, k] + A[:, k, k] * B[:, j, j] - 2.0 * A[:, j, k] * B[:, j, k]
            for j, k in ((1, 2), (2, 0), (0, 1))
        ],
        axis=-1,
    )
    return (0.25 / dt**2) * variance[:, :, None] * np.eye(3)
