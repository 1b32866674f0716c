"""Methods Gs, As and GA of Gong et al.: the filter over time and its smoother."""

from dataclasses import dataclass

import numpy as np

from avionics.pos.compiled import Array, IndexArray, compiled
from avionics.pos.difference_model import (
    RATE,
    RHO,
    THETA,
    Layout,
    Switches,
    layout,
    pattern_of,
    transition,
)
from avionics.pos.estimate import Estimate, Estimates
from avionics.pos.flexure import discretise
from avionics.pos.force_rows import force_rows
from avionics.pos.gyro_rows import gyro_rows
from avionics.pos.kalman import propagate, scalar_update
from avionics.pos.second_order import second_order_variance
from avionics.pos.simulate import Measured, Node, Sampling
from avionics.pos.smoother import smooth_constant

DEFAULT_RHO_SIGMA = np.deg2rad(0.5)


@dataclass(frozen=True, slots=True)
class DifferenceOptions:
    """Which sensors are compared, and how exactly.

    Attributes
    ----------
    gyros, forces : bool
        Gs has the first, As the second, GA both.
    nonlinear : bool
        Exact measurement instead of the paper's H x.
    sampling : {"instant", "integrating"}
        What the filter takes a sample to be. "integrating": the mean over the
        step, as of a chip that puts out angle increments.
    arm_in_H : bool
        As: [(f_m + a_r) x] instead of the paper's [f_m x].
    arm_model : bool
        As, GA: model the arm that turns with the flexure.
    rho_sigma : float
        Initial one-sigma of the misalignment, rad.
    """

    gyros: bool = True
    forces: bool = False
    nonlinear: bool = True
    sampling: Sampling = "integrating"
    arm_in_H: bool = True
    arm_model: bool = False
    rho_sigma: float = DEFAULT_RHO_SIGMA


def difference_filter(
    measured: Measured,
    node: Node,
    dt: float,
    options: DifferenceOptions,
    *,
    stride: int = 5,
    smooth: bool = False,
) -> Estimates:
    """Estimate the angles from differences of inertial sensors.

    Parameters
    ----------
    measured : Measured
        Sensors, N + 1 instants.
    node : Node
        Lever arm, flexure law and noise levels that the filter is given; rho is not read.
    dt : float
        Step, s.
    options : DifferenceOptions
        The method.
    stride : int
        Every how many steps an output is kept.
    smooth : bool
        Also run the fixed-interval smoother.

    Raises
    ------
    ValueError
        If neither gyros nor accelerometers are used, or a flexing arm is to be modelled exactly
        from accelerometers alone: the angle about the vertical, which they do not observe, then
        turns the arm's white acceleration, and the linearisation fails.
    """
    if not (options.gyros or options.forces):
        msg = "a difference filter wants gyros, accelerometers or both"
        raise ValueError(msg)
    if options.forces and not options.gyros and options.nonlinear and options.arm_model:
        msg = "accelerometers alone with arm_model want nonlinear = False"
        raise ValueError(msg)
    integrating = options.sampling == "integrating"
    at, size = layout(
        gyros=options.gyros,
        forces=options.forces,
        d_theta=integrating,
        d_rate=options.forces and options.arm_model,
    )
    how = Switches(options.nonlinear, integrating, options.arm_in_H, options.arm_model)
    D, Q = transition(*discretise(node.flexure, dt), at, size)
    rate_dot = rate_derivative(measured.rate_m, dt)
    arm = np.cross(measured.rate_m, np.cross(measured.rate_m, node.r0)) + np.cross(
        rate_dot, node.r0
    )
    variance = np.concatenate(
        [
            np.full(3, node.master.gyro_noise**2 + node.slave.gyro_noise**2),
            np.full(3, node.master.force_noise**2 + node.slave.force_noise**2),
        ]
    )
    steps = len(measured.rate_m) - 1
    index = np.arange(0, steps + 1, stride)
    rows = 3 * (int(options.gyros) + int(options.forces))
    kept = steps if smooth else 0
    history = (
        np.empty((kept, rows, size)),
        np.empty((kept, rows, size)),
        np.empty((kept, rows, 2)),
    )
    x = np.zeros((len(index), size))
    P_rows = np.empty((len(index), 6, size))
    P0 = initial_covariance(node, options, at, size)
    pattern = pattern_of(D)
    _filter_loop(
        measured.rate_m, measured.rate_s, measured.force_m, measured.force_s, arm, rate_dot,
        node.r0, dt, at, how, D, pattern, Q, P0, variance, stride, x, P_rows, history,
    )  # fmt: skip
    filtered = Estimate(index, x[:, RHO:THETA], x[:, THETA:RATE], P_rows[:, :, :6].copy())
    if not smooth:
        return Estimates(filtered)
    angle = np.concatenate([filtered.rho, filtered.theta], axis=1)
    covariance = filtered.covariance.copy()
    smooth_constant(P_rows, *history, D, pattern, stride, angle, covariance)
    return Estimates(filtered, Estimate(index, angle[:, :3], angle[:, 3:], covariance))


def rate_derivative(rate: Array, dt: float) -> Array:
    """Return the angular acceleration, rad/s^2, by central differences of fourth order.

    Parameters
    ----------
    rate : ndarray, shape (N + 1, 3)
        rad/s; means over the steps give the means of the derivative.
    dt : float
        Step, s.
    """
    result: Array = np.gradient(rate, dt, axis=0)
    result[2:-2] = (rate[:-4] - 8.0 * rate[1:-3] + 8.0 * rate[3:-1] - rate[4:]) / (12.0 * dt)
    return result


def initial_covariance(node: Node, options: DifferenceOptions, at: Layout, size: int) -> Array:
    """Return P at the start: misalignment, stationary flexure, sensor constants."""
    variance = np.zeros(size)
    variance[RHO:THETA] = options.rho_sigma**2
    variance[THETA:RATE] = node.flexure.sigma**2
    variance[RATE : RATE + 3] = node.flexure.rate_sigma**2
    for place, sigma in (
        (at.gyro_bias_m, node.master.gyro_bias),
        (at.gyro_bias_s, node.slave.gyro_bias),
        (at.force_bias_m, node.master.force_bias),
        (at.force_bias_s, node.slave.force_bias),
    ):
        if place >= 0:
            variance[place : place + 3] = sigma**2
    return np.diag(variance)


@compiled
def _filter_loop(
    rate_m: Array,
    rate_s: Array,
    force_m: Array,
    force_s: Array,
    arm: Array,
    rate_dot: Array,
    r0: Array,
    dt: float,
    at: Layout,
    how: Switches,
    D: Array,
    pattern: IndexArray,
    Q: Array,
    P0: Array,
    variance: Array,
    stride: int,
    x_out: Array,
    P_out: Array,
    history: tuple[Array, Array, Array],
) -> None:
    n = P0.shape[0]
    H_kept, K_kept, sy_kept = history
    P, x, dx = P0.copy(), np.zeros(n), np.zeros(n)
    W, A = np.empty((n, n)), np.empty((10, 3, 3))
    H, y, K, g = np.zeros((6, n)), np.zeros(6), np.empty(n), np.empty(n)
    extra = np.zeros(6)
    P_out[0] = P[:6]
    for k in range(1, rate_m.shape[0]):
        for e in range(pattern.shape[0]):
            dx[pattern[e, 0]] += D[pattern[e, 0], pattern[e, 1]] * x[pattern[e, 1]]
        for i in range(n):
            x[i] += dx[i]
        propagate(P, D, pattern, Q, W)
        rows = 0
        if at.gyro_bias_m >= 0:
            gyro_rows(x, rate_m[k], rate_s[k], dt, at, how, H[:3], y[:3], A)
            rows = 3
        if at.force_bias_m >= 0:
            force_rows(
                x, force_m[k], arm[k], force_s[k], rate_m[k], rate_dot[k], r0, dt, at, how,
                H[rows : rows + 3], y[rows : rows + 3], A,
            )  # fmt: skip
            rows += 3
        first = 0 if at.gyro_bias_m >= 0 else 3
        if how.nonlinear:
            second_order_variance(x, P, r0, dt, at, how, extra)
        dx[:] = 0.0
        for row in range(rows):
            innovation = y[row]
            for i in range(n):
                innovation -= H[row, i] * dx[i]
            s = scalar_update(
                P, dx, H[row], variance[first + row] + extra[first + row], innovation, K, g
            )
            if H_kept.shape[0] > 0:
                H_kept[k - 1, row] = H[row]
                K_kept[k - 1, row] = K
                sy_kept[k - 1, row, 0], sy_kept[k - 1, row, 1] = s, innovation
        for i in range(n):
            x[i] += dx[i]
            dx[i] = 0.0
        if k % stride == 0:
            x_out[k // stride] = x
            P_out[k // stride] = P[:6]
