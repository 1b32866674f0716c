"""Guo and Zhu's 15-state alignment: velocity and attitude matching with one modal flexure axis.

Its states are a selection of the 24 of method IMU: height and vertical velocity come from the
master, position errors are not estimated, and only the y axis flexes.
"""

import numpy as np

from avionics.pos.attitude import euler_difference_matrix, skew
from avionics.pos.compiled import Array, IndexArray, compiled
from avionics.pos.difference_model import pattern_of
from avionics.pos.estimate import Estimate, Estimates
from avionics.pos.flexure import discretise
from avionics.pos.imu_filter import ImuOptions, initial_covariance
from avionics.pos.imu_model import (
    PHI,
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
from avionics.pos.simulate import Measured, Node, measured_attitude
from avionics.pos.smoother import smooth_varying
from avionics.pos.trajectory import Trajectory

STATES = np.array([0, 1, 2, 3, 4, 9, 10, 11, 12, 13, 15, 16, 17, THETA + 1, RATE + 1])
ROWS = np.array([0, 1, 3, 4, 5])  # of the method IMU: east and north velocity, three angles
ANGLES = np.array([RHO, RHO + 1, RHO + 2, THETA, THETA + 1, THETA + 2])


def wing_filter(
    measured: Measured,
    node: Node,
    trajectory: Trajectory,
    options: ImuOptions,
    *,
    stride: int = 5,
    smooth: bool = False,
) -> Estimates:
    """Estimate misalignment and bending of a wing from velocity and attitude differences.

    Parameters
    ----------
    measured : Measured
        Sensors, N + 1 instants; integrating.
    node : Node
        Flexure law (axis y) and noise levels that the filter is given; rho is not read.
    trajectory : Trajectory
        The master's position and vertical velocity, which the slave takes over.
    options : ImuOptions
        ``nonlinear``, ``every`` and ``rho_sigma`` are used.
    stride : int
        Every how many steps an output is kept.
    smooth : bool
        Also run the fixed-interval smoother.

    Notes
    -----
    Guo and Zhu, Eq. 17-19, completed by the specification, Sec. 9.
    """
    dt, steps, size = trajectory.dt, len(measured.rate_s) - 1, len(STATES)
    Phi, Q_flex = discretise(node.flexure, dt)
    D, Q = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    pair = [THETA + 1, RATE + 1]
    D[np.ix_(pair, pair)] = Phi[1] - np.eye(2)
    Q[np.ix_(pair, pair)] = Q_flex[1]
    for place, sigma in ((PHI, node.slave.gyro_noise), (VELOCITY, node.slave.force_noise)):
        Q[range(place, place + 3), range(place, place + 3)] = (sigma * dt) ** 2
    reference, C_m = node.reference, measured_attitude(measured)
    noise = [*[reference.velocity] * 3, reference.heading, reference.pitch, reference.roll]
    pattern = pattern_of((np.abs(D) + dynamics_places())[np.ix_(STATES, STATES)])
    index = np.arange(0, steps + 1, stride)
    kept = steps // options.every if smooth else 0
    history = (np.empty((kept, 5, size)), np.empty((kept, 5, size)), np.empty((kept, 5, 2)))
    dynamics = np.empty((steps if smooth else 0, len(pattern)))
    angle, P_rows = np.zeros((len(index), 6)), np.zeros((len(index), 6, size))
    P0 = initial_covariance(C_m[0], node, options)[np.ix_(STATES, STATES)]
    rows_of_P = np.array([np.flatnonzero(a == STATES)[0] if a in STATES else -1 for a in ANGLES])
    position = np.stack([trajectory.latitude, trajectory.longitude, trajectory.height], axis=-1)
    M = euler_difference_matrix(measured.euler[:, 0], measured.euler[:, 1])
    _filter_loop(
        measured.rate_s, measured.force_s, measured.euler, C_m, measured.velocity, M, position,
        trajectory.velocity, skew(np.zeros(3)), dt, options.every, options.nonlinear, D, pattern,
        Q[np.ix_(STATES, STATES)], P0, np.array(noise)[ROWS] ** 2, stride, rows_of_P, angle,
        P_rows, history, dynamics,
    )  # fmt: skip
    covariance = np.zeros((len(index), 6, 6))
    used = rows_of_P >= 0
    covariance[:, :, used] = P_rows[:, :, rows_of_P[used]]
    filtered = Estimate(index, angle[:, :3], angle[:, 3:], covariance)
    if not smooth:
        return Estimates(filtered)
    angle, small = angle.copy(), P_rows[:, :, rows_of_P].copy()
    smooth_varying(P_rows, *history, dynamics, pattern, options.every, stride, angle, small)
    small[:, ~used] = 0.0
    small[:, :, ~used] = 0.0
    return Estimates(filtered, Estimate(index, angle[:, :3], angle[:, 3:], small))


@compiled
def _filter_loop(
    rate: Array,
    force: Array,
    euler: Array,
    C_m: Array,
    V_m: Array,
    M: Array,
    position: Array,
    V_true: Array,
    no_arm: Array,
    dt: float,
    every: int,
    nonlinear: bool,
    D: Array,
    pattern: IndexArray,
    Q: Array,
    P0: Array,
    variance: Array,
    stride: int,
    rows_of_P: IndexArray,
    angle: Array,
    P_out: Array,
    history: tuple[Array, Array, Array],
    dynamics: Array,
) -> None:
    H_kept, K_kept, sy_kept = history
    n = P0.shape[0]
    P, bias, flex, D_n = P0.copy(), np.zeros(6), np.zeros(9), np.zeros((n, n))
    W, A, H, y = np.empty((n, n)), np.empty((8, 3, 3)), np.zeros((6, SIZE)), np.zeros(6)
    K, g, h = np.empty(n), np.empty(n), np.empty(n)
    C, V, dx, dx_n = C_m[0].copy(), V_m[0].copy(), np.zeros(SIZE), np.zeros(n)
    force_n, place = np.zeros(3), position[0].copy()
    a, b = THETA + 1, RATE + 1
    _keep_rows(P, rows_of_P, P_out[0])
    for k in range(1, rate.shape[0]):
        V[2] = 0.5 * (V_true[k - 1, 2] + V_true[k, 2])
        strapdown(C, V, place, rate[k], force[k], bias, dt, force_n, A)
        V[2] = V_true[k, 2]
        place[:] = position[k]
        error_dynamics(D, C, force_n, V, place, dt)
        flex[4], flex[7] = (
            flex[4] + D[a, a] * flex[4] + D[a, b] * flex[7],
            flex[7] + D[b, a] * flex[4] + D[b, b] * flex[7],
        )
        for e in range(pattern.shape[0]):
            i, j = pattern[e, 0], pattern[e, 1]
            D_n[i, j] = D[STATES[i], STATES[j]]
            if dynamics.shape[0] > 0:
                dynamics[k - 1, e] = D_n[i, j]
        propagate(P, D_n, pattern, Q, W)
        if k % every == 0:
            measurement_rows(C, V, flex, euler[k], C_m[k], V_m[k], M[k], no_arm, nonlinear, H, y, A)
            dx_n[:] = 0.0
            for row in range(ROWS.shape[0]):
                innovation = y[ROWS[row]]
                for i in range(n):
                    h[i] = H[ROWS[row], STATES[i]]
                    innovation -= h[i] * dx_n[i]
                s = scalar_update(P, dx_n, h, variance[row], innovation, K, g)
                if H_kept.shape[0] > 0:
                    kept = k // every - 1
                    H_kept[kept, row] = h
                    K_kept[kept, row] = K
                    sy_kept[kept, row, 0], sy_kept[kept, row, 1] = s, innovation
            for i in range(n):
                dx[STATES[i]] = dx_n[i]
            feed_back(C, V, place, bias, flex, dx, A)
        if k % stride == 0:
            angle[k // stride] = flex[:6]
            _keep_rows(P, rows_of_P, P_out[k // stride])


@compiled
def _keep_rows(P: Array, rows: IndexArray, out: Array) -> None:
    """Copy the rows of P that belong to the angles; an angle without a state keeps zeros."""
    for i in range(rows.shape[0]):
        if rows[i] >= 0:
            out[i] = P[rows[i]]
