"""Method IMU of Gong et al.: 24-state transfer alignment by velocity and attitude matching."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from avionics.pos import earth
from avionics.pos.attitude import euler_difference_matrix, skew
from avionics.pos.compiled import Array, IndexArray, compiled
from avionics.pos.difference_filter import DEFAULT_RHO_SIGMA
from avionics.pos.difference_model import pattern_of
from avionics.pos.estimate import Estimate, Estimates
from avionics.pos.flexure import discretise
from avionics.pos.imu_model import (
    BIAS_F,
    BIAS_G,
    PHI,
    POSITION,
    RATE,
    RHO,
    SIZE,
    THETA,
    VELOCITY,
    dynamics_places,
    error_dynamics,
    feed_back,
    measurement_rows,
    strapdown,
)
from avionics.pos.kalman import propagate, scalar_update
from avionics.pos.motion import Start
from avionics.pos.simulate import Measured, Node, Sampling, measured_attitude
from avionics.pos.smoother import smooth_varying

POSITION_SIGMA = 0.1  # m, the master's position error that the slave starts with


@dataclass(frozen=True, slots=True)
class ImuOptions:
    """How the transfer alignment is done.

    Attributes
    ----------
    nonlinear : bool
        Attitude residual M log(C_s exp(u)^T C_m^T) instead of Euler differences minus H x.
    sampling : {"instant", "integrating"}
        What the filter takes a sample to be.
    every : int
        Update at every so-many samples.
    arm_rate : bool
        Add C (theta_dot x r0) to the velocity model.
    sampling_noise : float
        Factor on the angular noise that covers instant sampling, sqrt(Q T^2 / 12) per sqrt(s).
    rho_sigma : float
        Initial one-sigma of the misalignment, rad.
    """

    nonlinear: bool = True
    sampling: Sampling = "integrating"
    every: int = 1
    arm_rate: bool = True
    sampling_noise: float = 0.0
    rho_sigma: float = DEFAULT_RHO_SIGMA


class _Drive(NamedTuple):
    """Inputs of the loop, all by instant: increments of the slave, reference of the master."""

    rate: Array
    force: Array
    euler: Array
    attitude: Array
    velocity: Array
    M: Array


def imu_filter(
    measured: Measured,
    node: Node,
    start: Start,
    dt: float,
    options: ImuOptions,
    *,
    stride: int = 5,
    smooth: bool = False,
) -> Estimates:
    """Estimate the angles by aligning the slave's strapdown with the master.

    Parameters
    ----------
    measured : Measured
        Sensors, N + 1 instants.
    node : Node
        Lever arm, flexure law and noise levels that the filter is given; rho is not read.
    start : Start
        The master's position at the start.
    dt : float
        Step, s.
    options : ImuOptions
        The variant.
    stride : int
        Every how many steps an output is kept.
    smooth : bool
        Also run the fixed-interval smoother.

    Notes
    -----
    Gong et al., Eq. 2-8, with output = truth + error. Closed loop: after each update attitude,
    velocity, position and biases are corrected and their error states return to zero.
    """
    drive = _drive(measured, node, start, options)
    Phi, Q_flex = discretise(node.flexure, dt)
    D, Q = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    for axis in range(3):
        pair = [THETA + axis, RATE + axis]
        D[np.ix_(pair, pair)] = Phi[axis] - np.eye(2)
        Q[np.ix_(pair, pair)] = Q_flex[axis]
    Q[PHI : PHI + 3, PHI : PHI + 3] = np.eye(3) * (node.slave.gyro_noise * dt) ** 2
    Q[VELOCITY : VELOCITY + 3, VELOCITY : VELOCITY + 3] = (
        np.eye(3) * (node.slave.force_noise * dt) ** 2
    )
    path = options.sampling_noise**2 * node.flexure.psd * dt**3 / 12.0
    reference = node.reference
    variance = (
        np.array([*[reference.velocity] * 3, reference.heading, reference.pitch, reference.roll])
        ** 2
    )
    pattern = pattern_of(np.abs(D) + dynamics_places())
    steps = len(measured.rate_s) - 1
    index = np.arange(0, steps + 1, stride)
    kept = steps // options.every if smooth else 0
    history = (np.empty((kept, 6, SIZE)), np.empty((kept, 6, SIZE)), np.empty((kept, 6, 2)))
    dynamics = np.empty((steps if smooth else 0, len(pattern)))
    angle = np.zeros((len(index), 6))
    P_rows = np.empty((len(index), 6, SIZE))
    P0 = initial_covariance(drive.attitude[0], node, options)
    position = np.array([start.latitude, start.longitude, start.height])
    arm = skew(node.r0) * (1.0 if options.arm_rate else 0.0)
    _filter_loop(
        drive, position, arm, dt, options.every, options.nonlinear, D, pattern, Q, path, P0,
        variance, stride, angle, P_rows, history, dynamics,
    )  # fmt: skip
    filtered = Estimate(index, angle[:, :3], angle[:, 3:], P_rows[:, :, RHO : RHO + 6].copy())
    if not smooth:
        return Estimates(filtered)
    angle, covariance = angle.copy(), filtered.covariance.copy()
    smooth_varying(P_rows, *history, dynamics, pattern, options.every, stride, angle, covariance)
    return Estimates(filtered, Estimate(index, angle[:, :3], angle[:, 3:], covariance))


def _drive(measured: Measured, node: Node, start: Start, options: ImuOptions) -> _Drive:
    """Slave increments over each step, and the velocity that a rigid arm would have."""
    rate, force, rate_m = measured.rate_s.copy(), measured.force_s.copy(), measured.rate_m.copy()
    if options.sampling == "instant":
        rate[1:] = 0.5 * (measured.rate_s[1:] + measured.rate_s[:-1])
        force[1:] = 0.5 * (measured.force_s[1:] + measured.force_s[:-1])
    else:
        rate_m[1:] += 0.5 * (measured.rate_m[1:] - measured.rate_m[:-1])
    C = measured_attitude(measured)
    # The earth's rate at the start: a flight's change of latitude is worth micrometres a second.
    earth_in_m = np.einsum("kji,j->ki", C, earth.earth_rate(np.array(start.latitude)))
    lever = np.einsum("kij,kj->ki", C, np.cross(rate_m - earth_in_m, node.r0))
    M = euler_difference_matrix(measured.euler[:, 0], measured.euler[:, 1])
    return _Drive(rate, force, measured.euler, C, measured.velocity + lever, M)


def initial_covariance(C_m: Array, node: Node, options: ImuOptions) -> Array:
    """Return P at the start, shape (24, 24).

    The slave starts with the master's measured attitude and velocity: phi(0) = C u(0) - noise,
    so attitude and angles are correlated, as are velocity and flexure rate of a flexing arm.
    """
    reference, flexure = node.reference, node.flexure
    P = np.zeros((SIZE, SIZE))
    P[RHO : RHO + 3, RHO : RHO + 3] = np.eye(3) * options.rho_sigma**2
    P[THETA : THETA + 3, THETA : THETA + 3] = np.diag(flexure.sigma**2)
    P[RATE : RATE + 3, RATE : RATE + 3] = np.diag(flexure.rate_sigma**2)
    P[BIAS_G : BIAS_G + 3, BIAS_G : BIAS_G + 3] = np.eye(3) * node.slave.gyro_bias**2
    P[BIAS_F : BIAS_F + 3, BIAS_F : BIAS_F + 3] = np.eye(3) * node.slave.force_bias**2
    latitude_sigma = POSITION_SIGMA / earth.EQUATOR_RADIUS
    P[range(POSITION, POSITION + 3), range(POSITION, POSITION + 3)] = (
        np.array([latitude_sigma, latitude_sigma, POSITION_SIGMA]) ** 2
    )
    J = np.eye(SIZE)
    J[PHI : PHI + 3, RHO : RHO + 3] = J[PHI : PHI + 3, THETA : THETA + 3] = C_m
    if options.arm_rate:
        J[VELOCITY : VELOCITY + 3, RATE : RATE + 3] = C_m @ skew(node.r0)
    P = J @ P @ J.T
    attitude = max(reference.heading, reference.pitch, reference.roll)
    P[PHI : PHI + 3, PHI : PHI + 3] += np.eye(3) * attitude**2
    P[VELOCITY : VELOCITY + 3, VELOCITY : VELOCITY + 3] += np.eye(3) * reference.velocity**2
    return P


@compiled
def _filter_loop(
    drive: _Drive,
    position: Array,
    arm: Array,
    dt: float,
    every: int,
    nonlinear: bool,
    D: Array,
    pattern: IndexArray,
    Q: Array,
    path: Array,
    P0: Array,
    variance: Array,
    stride: int,
    angle: Array,
    P_out: Array,
    history: tuple[Array, Array, Array],
    dynamics: Array,
) -> None:
    H_kept, K_kept, sy_kept = history
    P, bias, flex = P0.copy(), np.zeros(6), np.zeros(9)
    W, A, Q_k = np.empty((SIZE, SIZE)), np.empty((8, 3, 3)), Q.copy()
    H, y, K, g = np.zeros((6, SIZE)), np.zeros(6), np.empty(SIZE), np.empty(SIZE)
    C, V, dx = drive.attitude[0].copy(), drive.velocity[0].copy(), np.zeros(SIZE)
    force_n = np.zeros(3)
    P_out[0] = P[RHO : RHO + 6]
    for k in range(1, drive.rate.shape[0]):
        strapdown(C, V, position, drive.rate[k], drive.force[k], bias, dt, force_n, A)
        error_dynamics(D, C, force_n, V, position, dt)
        for i in range(3):
            theta = flex[3 + i] + D[THETA + i, THETA + i] * flex[3 + i]
            theta += D[THETA + i, RATE + i] * flex[6 + i]
            flex[6 + i] += (
                D[RATE + i, THETA + i] * flex[3 + i] + D[RATE + i, RATE + i] * flex[6 + i]
            )
            flex[3 + i] = theta
            for j in range(3):
                Q_k[i, j] = Q[i, j]
                for axis in range(3):
                    Q_k[i, j] += C[i, axis] * path[axis] * C[j, axis]
        propagate(P, D, pattern, Q_k, W)
        if dynamics.shape[0] > 0:
            for e in range(pattern.shape[0]):
                dynamics[k - 1, e] = D[pattern[e, 0], pattern[e, 1]]
        if k % every == 0:
            measurement_rows(
                C, V, flex, drive.euler[k], drive.attitude[k], drive.velocity[k], drive.M[k],
                arm, nonlinear, H, y, A,
            )  # fmt: skip
            dx[:] = 0.0
            for row in range(6):
                innovation = y[row]
                for i in range(SIZE):
                    innovation -= H[row, i] * dx[i]
                s = scalar_update(P, dx, H[row], variance[row], innovation, K, g)
                if H_kept.shape[0] > 0:
                    kept = k // every - 1
                    H_kept[kept, row] = H[row]
                    K_kept[kept, row] = K
                    sy_kept[kept, row, 0], sy_kept[kept, row, 1] = s, innovation
            feed_back(C, V, position, bias, flex, dx, A)
        if k % stride == 0:
            angle[k // stride] = flex[:6]
            P_out[k // stride] = P[RHO : RHO + 6]
