"""What no filter can beat: the Riccati bound of each method, computed apart from the filters.

Shared with the filter code are the rotation formulas (``attitude``) and the earth's model
(``earth``), no filter equation. Transition matrices come from numerical derivatives of an
independent strapdown, measurement matrices from numerical derivatives of the exact measurement
along the true path; covariances are dense and step by plain matrix products.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from avionics.pos.attitude import (
    right_jacobian,
    rotation_from_vector,
)
from avionics.pos.compiled import Array
from avionics.pos.simulate import Node, SlaveTruth
from avionics.pos.trajectory import Trajectory

RHO, THETA, RATE, THETA_BEFORE = slice(0, 3), slice(3, 6), slice(6, 9), slice(21, 24)
TINY = 1e-6  # rad, m/s and SI: step of the numerical derivatives


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """Least possible one-sigma of the system error angle.

    Attributes
    ----------
    t : ndarray, shape (K,)
        s.
    sigma : ndarray, shape (K, 3)
        rad.
    """

    t: Array
    sigma: Array


def difference_bound(
    trajectory: Trajectory,
    node: Node,
    truth: SlaveTruth,
    *,
    gyros: bool,
    forces: bool,
    stride: int = 100,
) -> Bound:
    """Return the bound of method Gs, As or GA with integrating sensors, along the true path.

    Parameters
    ----------
    trajectory, node, truth
        As ``simulate`` made them; the information is that of this path.
    gyros, forces : bool
        Which differences are measured.
    stride : int
        Every how many steps the result is kept.

    Notes
    -----
    State [rho, theta, theta_dot, eps_m, eps_s, nabla_m, nabla_s, theta_(k-1), theta_dot_(k-1)].
    Gyros measure log(exp(-u_(k-1)) exp(w dt) exp(u_k)) / dt, accelerometers the mean of
    exp(u)^T (f + a_r) at both ends. With gyros alone the derivative by the angle is taken without
    flexure: the rotation of unknown driving noise is no information.
    """
    Phi, Q = _clone_model(node, trajectory.dt)
    grades = [node.master.gyro_bias, node.slave.gyro_bias, node.master.force_bias]
    grades.append(node.slave.force_bias)
    clones = np.concatenate([node.flexure.sigma, node.flexure.rate_sigma]) ** 2
    P = np.diag(np.concatenate([flexing_variance(node), np.repeat(grades, 3) ** 2, clones]))
    parts, noise = [], []
    if gyros:
        parts.append(_gyro_jacobians(trajectory, truth, flexure_seen=forces))
        noise += [node.master.gyro_noise**2 + node.slave.gyro_noise**2] * 3
    if forces:
        parts.append(_force_jacobians(trajectory, node, truth))
        noise += [node.master.force_noise**2 + node.slave.force_noise**2] * 3
    H_all, R = np.concatenate(parts, axis=1), np.diag(noise)
    kept, sigma = [0], [angle_sigma(P)]
    for k in range(1, len(H_all)):
        P = Phi @ P @ Phi.T + Q
        P = updated(P, H_all[k], R)
        if k % stride == 0:
            kept.append(k)
            sigma.append(angle_sigma(P))
    return Bound(trajectory.t[kept], np.array(sigma))


def _gyro_jacobians(trajectory: Trajectory, truth: SlaveTruth, *, flexure_seen: bool) -> Array:
    """Differentiate the gyro difference by the states, shape (N + 1, 3, 27)."""
    u, dt = truth.system_angle, trajectory.dt
    turned = derivative(lambda d: _into_slave(u + d, trajectory.rate), u)
    if flexure_seen:
        flexing = np.gradient(truth.theta, dt, axis=0)
        turned += 0.5 * np.stack([np.cross(flexing, e) for e in np.eye(3)], axis=-1)
    by_step = np.stack(
        [_into(right_jacobian(u), np.broadcast_to(e, u.shape)) for e in np.eye(3)], axis=-1
    )
    H = np.zeros((len(u), 3, 27))
    H[:, :, RHO] = turned
    H[:, :, THETA] = 0.5 * turned + by_step / dt
    H[:, :, THETA_BEFORE] = 0.5 * turned - by_step / dt
    H[:, :, 9:12] = -np.swapaxes(rotation_from_vector(u), -1, -2)
    H[:, :, 12:15] = np.eye(3)
    return H


def _force_jacobians(trajectory: Trajectory, node: Node, truth: SlaveTruth) -> Array:
    """Differentiate the accelerometer difference by the states, shape (N + 1, 3, 27)."""
    u, dt, r0, w = truth.system_angle, trajectory.dt, node.r0, trajectory.rate
    rigid = np.cross(w, np.cross(w, r0)) + np.cross(trajectory.rate_dot, r0)
    ends = derivative(lambda d: _into_slave(u + d, trajectory.force + rigid), u)
    before = np.roll(ends, 1, axis=0)
    H = np.zeros((len(u), 3, 27))
    H[:, :, RHO] = 0.5 * (ends + before)
    H[:, :, THETA], H[:, :, THETA_BEFORE] = 0.5 * ends, 0.5 * before
    H[:, :, 15:18] = -np.swapaxes(rotation_from_vector(u), -1, -2)
    H[:, :, 18:21] = np.eye(3)
    if node.arm == "flexing":
        for axis, e in enumerate(np.eye(3)):
            arm = np.cross(e, r0)
            centripetal = np.cross(w, np.cross(w, arm)) + np.cross(trajectory.rate_dot, arm)
            coriolis = np.cross(w, arm)
            for place, sign in ((0, 1.0), (THETA_BEFORE.start - 3, -1.0)):
                H[:, :, place + 3 + axis] += 0.5 * _into_slave(u, centripetal)
                rate = coriolis + sign * arm / dt
                H[:, :, place + 6 + axis] += _into_slave(u, rate)
    return H


def _into_slave(u: Array, vector: Array) -> Array:
    return _into(np.swapaxes(rotation_from_vector(u), -1, -2), vector)


def _into(C: Array, vector: Array) -> Array:
    result: Array = np.einsum("kij,kj->ki", C, vector)
    return result


def derivative(function: Callable[[Array], Array], like: Array) -> Array:
    """Return central differences by a common offset of three components, shape (K, m, 3)."""
    columns = []
    for axis in range(3):
        d = np.zeros_like(like)
        d[..., axis] = TINY
        columns.append((function(d) - function(-d)) / (2.0 * TINY))
    return np.stack(columns, axis=-1)


def updated(P: Array, H: Array, R: Array) -> Array:
    """Return the covariance after a measurement, Joseph form."""
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    rest = np.eye(len(P)) - K @ H
    result: Array = rest @ P @ rest.T + K @ R @ K.T
    return result


def angle_sigma(P: Array) -> Array:
    """Return the one-sigma of rho + theta, rad, shape (3,)."""
    cross = P[RHO, THETA]
    result: Array = np.sqrt(np.diag(P[RHO, RHO] + P[THETA, THETA] + cross + cross.T))
    return result


def flexing_variance(node: Node) -> Array:
    """Return the initial variances of rho, theta and theta_dot, shape (9,)."""
    rho = np.full(3, np.deg2rad(0.5) ** 2)
    return np.concatenate([rho, node.flexure.sigma**2, node.flexure.rate_sigma**2])


def flexure_blocks(node: Node, dt: float) -> tuple[Array, Array]:
    """Return noise and transition of [rho, theta, theta_dot] from the covariance's own ODE."""
    law = node.flexure
    F = np.zeros((9, 9))
    F[THETA, RATE] = np.eye(3)
    F[RATE, THETA] = -np.diag(law.frequency**2)
    F[RATE, RATE] = -2.0 * np.diag(law.damping * law.frequency)
    G = np.zeros((9, 9))
    G[RATE, RATE] = np.diag(law.psd)
    # Lyapunov equation of the covariance, vectorised: its exponential is exact.
    lift = np.kron(F, np.eye(9)) + np.kron(np.eye(9), F)
    block = np.zeros((82, 82))
    block[:81, :81], block[:81, 81] = lift * dt, G.reshape(-1) * dt
    Q = expm(block)[:81, 81].reshape(9, 9)
    return Q, expm(F * dt)


def _clone_model(node: Node, dt: float) -> tuple[Array, Array]:
    """Transition and noise of the 27 states with both clones."""
    Q9, Phi9 = flexure_blocks(node, dt)
    Phi, Q = np.eye(27), np.zeros((27, 27))
    Phi[:9, :9], Q[:9, :9] = Phi9, Q9
    Phi[21:, 21:] = 0.0
    Phi[21:, 3:9] = np.eye(6)
    return Phi, Q
