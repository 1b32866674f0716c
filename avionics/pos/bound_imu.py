"""The Riccati bound of method IMU; see ``bound`` for what it stands on."""

import numpy as np

from avionics.pos import earth
from avionics.pos.attitude import euler_from_dcm, rotation_from_vector
from avionics.pos.bound import (
    RHO,
    THETA,
    Bound,
    angle_sigma,
    derivative,
    flexing_variance,
    flexure_blocks,
    updated,
)
from avionics.pos.compiled import Array, IndexArray
from avionics.pos.simulate import Node, SlaveTruth
from avionics.pos.trajectory import Trajectory


def imu_bound(
    trajectory: Trajectory, node: Node, truth: SlaveTruth, *, every: int = 1, hold: int = 10
) -> Bound:
    """Return the bound of method IMU, its attitude and velocity references at ``every`` samples.

    Parameters
    ----------
    trajectory, node, truth
        As ``simulate`` made them.
    every : int
        Samples between updates of the filter that is bounded.
    hold : int
        Updates over which the numerical derivatives are held.

    Notes
    -----
    State [rho, theta, theta_dot, phi, dV, dp (m), eps, nabla]; kept after every ``hold`` updates.
    """
    step = every * trajectory.dt
    P, reference = _imu_start(trajectory, node), node.reference
    Q, Phi = np.zeros((24, 24)), np.eye(24)
    Q[:9, :9], Phi[:9, :9] = flexure_blocks(node, step)
    Q[9:12, 9:12] = np.eye(3) * node.slave.gyro_noise**2 * trajectory.dt * step
    Q[12:15, 12:15] = np.eye(3) * node.slave.force_noise**2 * trajectory.dt * step
    R = np.diag([reference.velocity] * 3 + [reference.heading, reference.pitch, reference.roll])
    knots = np.arange(every, len(trajectory.t), every * hold)
    F_all = _navigation_jacobians(trajectory, truth, knots)
    H_all = _matching_jacobians(trajectory, node, truth, knots)
    kept, sigma = [0], [angle_sigma(P)]
    for F, H, knot in zip(F_all, H_all, knots, strict=True):
        Phi[9:, 9:] = np.eye(15) + F * step + 0.5 * (F @ F) * step**2
        for _ in range(min(hold, (len(trajectory.t) - 1 - int(knot)) // every + 1)):
            P = Phi @ P @ Phi.T + Q
            P = updated(P, H, R**2)
        kept.append(int(knot))
        sigma.append(angle_sigma(P))
    return Bound(trajectory.t[kept], np.array(sigma))


def _imu_start(trajectory: Trajectory, node: Node) -> Array:
    """Covariance at the start: attitude and velocity taken from the master."""
    C = trajectory.D_n_from_m[0]
    reference = node.reference
    independent = np.zeros(24)
    independent[:9] = flexing_variance(node)
    independent[9:12] = max(reference.heading, reference.pitch, reference.roll) ** 2
    independent[12:15] = reference.velocity**2
    independent[15:18] = 0.1**2
    independent[18:21] = node.slave.gyro_bias**2
    independent[21:24] = node.slave.force_bias**2
    J = np.eye(24)
    J[9:12, RHO] = J[9:12, THETA] = C
    if node.arm == "flexing":
        for axis in range(3):
            J[12:15, 6 + axis] = -(C @ np.cross(np.eye(3)[axis], node.r0))
    result: Array = J @ np.diag(independent) @ J.T
    return result


def _navigation_rates(state: Array, rate: Array, force: Array) -> Array:
    """Time derivative of perturbed navigation, shape (B, 9): attitude vector, V, position, m.

    ``state`` holds (B, 24 - 9) rows: nominal plus perturbation of attitude vector in n, velocity,
    latitude (rad), longitude, height, gyro and accelerometer bias.
    """
    phi, V, L, h = state[:, :3], state[:, 3:6], state[:, 6], state[:, 8]
    ie, en = earth.earth_rate(L), earth.transport_rate(L, h, V)
    in_n = ie + en
    turn = rotation_from_vector(-phi)
    w = np.einsum("bij,bj->bi", turn, rate + state[:, 9:12])
    f = np.einsum("bij,bj->bi", turn, force + state[:, 12:15])
    # n' computed from n: exp(-phi). Its rate against the frame that turns with the nominal body.
    phi_dot = in_n - w
    V_dot = f - np.cross(2.0 * ie + en, V)
    V_dot[:, 2] -= earth.gravity(L, h)
    place = np.stack(
        [
            V[:, 1] / (earth.meridian_radius(L) + h),
            V[:, 0] / ((earth.normal_radius(L) + h) * np.cos(L)),
            V[:, 2],
        ],
        axis=-1,
    )
    return np.concatenate([phi_dot, V_dot, place], axis=-1)


def _navigation_jacobians(trajectory: Trajectory, truth: SlaveTruth, at: IndexArray) -> Array:
    """Differentiate the navigation errors' rates by the errors, position in m, (K, 15, 15)."""
    C, V = truth.D_n_from_s[at], truth.velocity[at]
    L, h = trajectory.latitude[at], trajectory.height[at]
    count, radius = len(at), earth.EQUATOR_RADIUS
    rate = earth.earth_rate(L) + earth.transport_rate(L, h, V)
    force = np.einsum("kij,kj->ki", C, truth.force[at])
    place = np.stack([L, trajectory.longitude[at], h], axis=-1)
    nominal = np.concatenate([np.zeros((count, 3)), V, place, np.zeros((count, 6))], axis=1)
    J = np.tile(np.eye(15), (count, 1, 1))
    J[:, 6, 6] = J[:, 7, 7] = 1.0 / radius
    J[:, 9:12, 9:12], J[:, 12:15, 12:15] = C, C
    steps = np.repeat([1e-5, 1e-2, 10.0, 1e-6, 1e-3], 3)
    F = np.zeros((count, 15, 15))
    for column in range(15):
        offset = J[:, :, column] * steps[column]
        high = _navigation_rates(nominal + offset, rate, force)
        low = _navigation_rates(nominal - offset, rate, force)
        F[:, :9, column] = (high - low) / (2.0 * steps[column])
    F[:, 6:8] *= radius
    return F


def _matching_jacobians(
    trajectory: Trajectory, node: Node, truth: SlaveTruth, at: IndexArray
) -> Array:
    """Differentiate velocity and Euler-angle differences by the states, shape (K, 6, 24)."""
    C_s, u, C_m = truth.D_n_from_s[at], truth.system_angle[at], trajectory.D_n_from_m[at]

    def master(du: Array, phi: Array) -> Array:
        """Euler angles of the master that the computed slave and the angles' estimate imply."""
        back = np.swapaxes(rotation_from_vector(u - du), -1, -2)
        return euler_from_dcm(rotation_from_vector(-phi) @ C_s @ back)

    zero = np.zeros_like(u)
    H = np.zeros((len(at), 6, 24))
    H[:, :3, 12:15] = np.eye(3)
    by_u = derivative(lambda d: master(d, zero), u)
    H[:, 3:, RHO] = H[:, 3:, THETA] = by_u
    H[:, 3:, 9:12] = derivative(lambda d: master(zero, d), u)
    if node.arm == "flexing":
        for axis in range(3):
            H[:, :3, 6 + axis] = C_m @ np.cross(np.eye(3)[axis], node.r0)
    return H
