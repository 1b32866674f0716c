"""Master and slave sensors on a trajectory with a flexing arm: the truth and what is measured."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from avionics.pos import earth
from avionics.pos.attitude import (
    dcm_from_euler,
    right_jacobian,
    rotation_from_vector,
    vector_from_rotation,
)
from avionics.pos.compiled import Array
from avionics.pos.flexure import Flexure, sample_flexure
from avionics.pos.trajectory import Trajectory

Sampling = Literal["instant", "integrating"]
Arm = Literal["rigid", "flexing"]


@dataclass(frozen=True, slots=True)
class Grade:
    """One-sigmas of one node's inertial sensors; constants are drawn once per run.

    Attributes
    ----------
    gyro_bias, gyro_noise : float
        Constant, and white per sample, rad/s.
    force_bias, force_noise : float
        Constant, and white per sample, m/s^2.
    """

    gyro_bias: float
    gyro_noise: float
    force_bias: float
    force_noise: float


@dataclass(frozen=True, slots=True)
class Reference:
    """One-sigmas of the master's navigation solution, white per sample.

    Attributes
    ----------
    heading, pitch, roll : float
        rad.
    velocity : float
        Each axis, m/s.
    """

    heading: float
    pitch: float
    roll: float
    velocity: float


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A slave node: what it stands on and what it carries.

    Attributes
    ----------
    rho : ndarray, shape (3,)
        Rigid misalignment, rad.
    r0 : ndarray, shape (3,)
        Lever arm from master to slave in m, m.
    flexure : Flexure
        Three axes.
    master, slave : Grade
        Sensors.
    reference : Reference
        The master's navigation solution.
    gyro : {"instant", "integrating"}
        Rate at t_k, or rotation vector over the step by its length; accelerometers accordingly.
    arm : {"rigid", "flexing"}
        Whether the lever arm turns with the flexure.
    """

    rho: Array
    r0: Array
    flexure: Flexure
    master: Grade
    slave: Grade
    reference: Reference
    gyro: Sampling = "integrating"
    arm: Arm = "flexing"


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What the sensors measured, on the trajectory's grid of N + 1 instants.

    Attributes
    ----------
    euler, velocity : ndarray, shape (N + 1, 3)
        The master's heading, pitch, roll, rad, and velocity in n, m/s.
    rate_m, rate_s : ndarray, shape (N + 1, 3)
        Gyros of master and slave, rad/s.
    force_m, force_s : ndarray, shape (N + 1, 3)
        Accelerometers of master and slave, m/s^2.
    """

    euler: Array
    velocity: Array
    rate_m: Array
    rate_s: Array
    force_m: Array
    force_s: Array


@dataclass(frozen=True, slots=True, eq=False)
class SlaveTruth:
    """The slave's true state.

    Attributes
    ----------
    rho : ndarray, shape (3,)
        rad.
    theta, theta_dot : ndarray, shape (N + 1, 3)
        Flexure, rad, and rate, rad/s.
    velocity : ndarray, shape (N + 1, 3)
        In n, m/s.
    D_n_from_s : ndarray, shape (N + 1, 3, 3)
        Attitude.
    rate, force : ndarray, shape (N + 1, 3)
        Error-free output of the slave's sensors, rad/s and m/s^2.
    bias : dict of str to ndarray, shape (3,)
        Drawn constants: "rate_m", "rate_s" rad/s, "force_m", "force_s" m/s^2.
    """

    rho: Array
    theta: Array
    theta_dot: Array
    velocity: Array
    D_n_from_s: Array
    rate: Array
    force: Array
    bias: dict[str, Array]

    @property
    def system_angle(self) -> Array:
        """System error angle u = rho + theta, rad, shape (N + 1, 3)."""
        return self.rho + self.theta


def relative_acceleration(
    rate: Array, rate_dot: Array, r: Array, r_dot: Array, r_ddot: Array
) -> Array:
    """Return w x (w x r) + w_dot x r + 2 w x r_dot + r_ddot, m/s^2 (Gong et al., Eq. 23)."""
    result: Array = (
        np.cross(rate, np.cross(rate, r)) + np.cross(rate_dot, r) + 2.0 * np.cross(rate, r_dot)
    ) + r_ddot
    return result


def inertial_increments(D_i_from_b: Array, dt: float) -> Array:
    """Return rotation vectors of successive attitudes over dt, rad/s, shape (N, 3)."""
    step = np.swapaxes(D_i_from_b[:-1], -1, -2) @ D_i_from_b[1:]
    return vector_from_rotation(step) / dt


def simulate(
    trajectory: Trajectory, node: Node, rng: np.random.Generator
) -> tuple[SlaveTruth, Measured]:
    """Return one run: the slave's truth and all that was measured.

    Parameters
    ----------
    trajectory : Trajectory
        The master's motion, N steps.
    node : Node
        The slave.
    rng : numpy.random.Generator
        Independent streams are spawned from it for flexure, constants and each noise, so that
        switching one thing on or off leaves the other draws as they are.
    """
    streams = rng.spawn(8)
    steps = len(trajectory.t) - 1
    theta, theta_dot = sample_flexure(node.flexure, trajectory.dt, steps, streams[0])
    constants = streams[1].standard_normal((4, 3))
    bias = {
        "rate_m": node.master.gyro_bias * constants[0],
        "rate_s": node.slave.gyro_bias * constants[1],
        "force_m": node.master.force_bias * constants[2],
        "force_s": node.slave.force_bias * constants[3],
    }
    truth, rate_m, force_m = slave_truth(trajectory, node, theta, theta_dot, bias)

    def noisy(value: Array, sigma: float | Array, stream: int) -> Array:
        result: Array = value + sigma * streams[stream].standard_normal(value.shape)
        return result

    reference = node.reference
    attitude_sigma = np.array([reference.heading, reference.pitch, reference.roll])
    return truth, Measured(
        euler=noisy(trajectory.euler, attitude_sigma, 2),
        velocity=noisy(trajectory.velocity, reference.velocity, 3),
        rate_m=noisy(rate_m + bias["rate_m"], node.master.gyro_noise, 4),
        rate_s=noisy(truth.rate + bias["rate_s"], node.slave.gyro_noise, 5),
        force_m=noisy(force_m + bias["force_m"], node.master.force_noise, 6),
        force_s=noisy(truth.force + bias["force_s"], node.slave.force_noise, 7),
    )


def slave_truth(
    trajectory: Trajectory, node: Node, theta: Array, theta_dot: Array, bias: dict[str, Array]
) -> tuple[SlaveTruth, Array, Array]:
    """Return the slave's truth and the master's error-free rate and specific force.

    Parameters
    ----------
    trajectory : Trajectory
        N steps.
    node : Node
        The slave.
    theta, theta_dot : ndarray, shape (N + 1, 3)
        Flexure, rad, rad/s.
    bias : dict
        Constants, recorded only.

    Notes
    -----
    C_s^m = exp(u x), u = rho + theta, exactly. The mean of an accelerometer over a step is
    taken by the trapezoid rule, except for two terms whose mean is exact: the angular
    acceleration, (w_k - w_(k-1)) / dt x r, and the second derivative of the arm, white noise
    integrated once, which always enters as (theta_dot_k - theta_dot_(k-1)) / dt x r0.
    """
    dt, C_m = trajectory.dt, trajectory.D_n_from_m
    D_m_from_s = rotation_from_vector(node.rho + theta)
    flexes = 1.0 if node.arm == "flexing" else 0.0
    r = node.r0 + flexes * np.cross(theta, node.r0)
    r_dot = flexes * np.cross(theta_dot, node.r0)
    r_ddot = np.zeros_like(r)
    r_ddot[1:] = (r_dot[1:] - r_dot[:-1]) / dt
    still = np.zeros_like(r)
    rate = np.einsum("kji,kj->ki", D_m_from_s, trajectory.rate) + np.einsum(
        "kij,kj->ki", right_jacobian(node.rho + theta), theta_dot
    )
    rate_m, force_m, rate_dot = trajectory.rate.copy(), trajectory.force.copy(), still
    if node.gyro == "instant":
        rate_dot = trajectory.rate_dot
    steady = relative_acceleration(trajectory.rate, rate_dot, r, r_dot, still)
    force = np.einsum("kji,kj->ki", D_m_from_s, trajectory.force + steady)
    D_mean, unsteady = D_m_from_s.copy(), r_ddot
    if node.gyro == "integrating":
        C_m_i = (
            earth.inertial_from_navigation(trajectory.latitude, trajectory.longitude, trajectory.t)
            @ C_m
        )
        rate_m[1:] = inertial_increments(C_m_i, dt)
        rate[1:] = inertial_increments(C_m_i @ D_m_from_s, dt)
        force_m[1:] = 0.5 * (trajectory.force[1:] + trajectory.force[:-1])
        force[1:] = 0.5 * (force[1:] + force[:-1])
        D_mean[1:] = 0.5 * (D_m_from_s[1:] + D_m_from_s[:-1])
        turning = (trajectory.rate[1:] - trajectory.rate[:-1]) / dt
        unsteady[1:] += np.cross(turning, 0.5 * (r[1:] + r[:-1]))
    force = force + np.einsum("kji,kj->ki", D_mean, unsteady)
    relative_rate = trajectory.rate - np.einsum(
        "kji,kj->ki", C_m, earth.earth_rate(trajectory.latitude)
    )
    arm_velocity = np.einsum("kij,kj->ki", C_m, np.cross(relative_rate, r) + r_dot)
    truth = SlaveTruth(
        rho=node.rho,
        theta=theta,
        theta_dot=theta_dot,
        velocity=trajectory.velocity + arm_velocity,
        D_n_from_s=C_m @ D_m_from_s,
        rate=rate,
        force=force,
        bias=bias,
    )
    return truth, rate_m, force_m


def measured_attitude(measured: Measured) -> Array:
    """Return the master's measured C_m^n, shape (N + 1, 3, 3)."""
    return dcm_from_euler(measured.euler[:, 0], measured.euler[:, 1], measured.euler[:, 2])
