"""The carrier's true motion: position, exact inertial rates and specific force on WGS-84."""

from dataclasses import dataclass

import numpy as np

from avionics.pos import earth
from avionics.pos.attitude import dcm_from_euler
from avionics.pos.compiled import Array, compiled
from avionics.pos.motion import Motion, Start


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """The carrier's true motion on a regular grid of N + 1 instants.

    Attributes
    ----------
    dt : float
        Step, s.
    t : ndarray, shape (N + 1,)
        s.
    latitude, longitude, height : ndarray, shape (N + 1,)
        rad, rad, m.
    velocity : ndarray, shape (N + 1, 3)
        In n, m/s.
    euler : ndarray, shape (N + 1, 3)
        Heading, pitch, roll, rad.
    D_n_from_m : ndarray, shape (N + 1, 3, 3)
        Attitude of the master.
    rate, rate_dot : ndarray, shape (N + 1, 3)
        omega_im in m, rad/s, and its derivative, rad/s^2.
    force : ndarray, shape (N + 1, 3)
        Specific force in m, m/s^2.
    """

    dt: float
    t: Array
    latitude: Array
    longitude: Array
    height: Array
    velocity: Array
    euler: Array
    D_n_from_m: Array
    rate: Array
    rate_dot: Array
    force: Array


def trajectory_from_motion(motion: Motion, start: Start) -> Trajectory:
    """Return position, inertial rates and specific force of a motion.

    Parameters
    ----------
    motion : Motion
        Sampled at half steps, see ``half_step_times``.
    start : Start
        Initial position.

    Notes
    -----
    The position is integrated (Runge-Kutta of fourth order); all else is in closed form:
    f = C^T (V_dot + (2 omega_ie + omega_en) x V - g).
    """
    dt = float(motion.t[2] - motion.t[0])
    latitude, longitude, height = _integrate_position(
        motion.velocity, dt, start.latitude, start.longitude, start.height
    )
    t, V, V_dot = motion.t[::2], motion.velocity[::2], motion.velocity_d1[::2]
    euler, d1, d2 = motion.euler[::2], motion.euler_d1[::2], motion.euler_d2[::2]
    C = dcm_from_euler(euler[:, 0], euler[:, 1], euler[:, 2])
    ie, en = earth.earth_rate(latitude), earth.transport_rate(latitude, height, V)
    w_nb, w_nb_dot = body_rate_from_euler(euler, d1, d2)
    w_in = _into_body(C, ie + en)
    w_in_dot = _into_body(C, earth.transport_rate_derivative(latitude, height, V, V_dot))
    acceleration = V_dot + np.cross(2.0 * ie + en, V)
    acceleration[:, 2] += earth.gravity(latitude, height)
    return Trajectory(
        dt=dt,
        t=t,
        latitude=latitude,
        longitude=longitude,
        height=height,
        velocity=V,
        euler=euler,
        D_n_from_m=C,
        rate=w_nb + w_in,
        rate_dot=w_nb_dot + w_in_dot - np.cross(w_nb, w_in),
        force=_into_body(C, acceleration),
    )


def _into_body(C: Array, vector: Array) -> Array:
    """Components in the body of vectors given in n."""
    result: Array = np.einsum("kji,kj->ki", C, vector)
    return result


def body_rate_from_euler(euler: Array, d1: Array, d2: Array) -> tuple[Array, Array]:
    """Return omega_nb in b, rad/s, and its derivative, rad/s^2, shapes (K, 3).

    Parameters
    ----------
    euler, d1, d2 : ndarray, shape (K, 3)
        Heading, pitch, roll and derivatives: rad, rad/s, rad/s^2.
    """
    s_t, c_t = np.sin(euler[:, 1]), np.cos(euler[:, 1])
    s_g, c_g = np.sin(euler[:, 2]), np.cos(euler[:, 2])
    psi, theta, gamma = d1.T
    psi2, theta2, gamma2 = d2.T
    rate = [c_g * theta + s_g * c_t * psi, gamma - s_t * psi, s_g * theta - c_g * c_t * psi]
    rate_dot = [
        c_g * theta2
        + s_g * c_t * psi2
        + gamma * (c_g * c_t * psi - s_g * theta)
        - s_g * s_t * theta * psi,
        gamma2 - s_t * psi2 - c_t * theta * psi,
        s_g * theta2
        - c_g * c_t * psi2
        + gamma * (c_g * theta + s_g * c_t * psi)
        + c_g * s_t * theta * psi,
    ]
    return np.stack(rate, axis=-1), np.stack(rate_dot, axis=-1)


@compiled
def _integrate_position(
    velocity: Array, dt: float, latitude0: float, longitude0: float, height0: float
) -> tuple[Array, Array, Array]:
    steps = (velocity.shape[0] - 1) // 2
    latitude, longitude, height = np.empty(steps + 1), np.empty(steps + 1), np.empty(steps + 1)
    L, lon, h = latitude0, longitude0, height0
    latitude[0], longitude[0], height[0] = L, lon, h
    for k in range(steps):
        L_k, h_k = L, h
        L_i, h_i = L, h
        for stage in range(4):
            v = velocity[2 * k + (stage + 1) // 2]
            L_dot = v[1] / (earth.meridian_radius(L_i) + h_i)
            lon_dot = v[0] / ((earth.normal_radius(L_i) + h_i) * np.cos(L_i))
            weight = dt / 6.0 if stage in (0, 3) else dt / 3.0
            L += weight * L_dot
            lon += weight * lon_dot
            h += weight * v[2]
            ahead = dt if stage == 2 else 0.5 * dt
            L_i, h_i = L_k + ahead * L_dot, h_k + ahead * v[2]
        latitude[k + 1], longitude[k + 1], height[k + 1] = L, lon, h
    return latitude, longitude, height
