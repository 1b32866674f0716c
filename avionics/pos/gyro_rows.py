"""Gyro rows of the difference filters: Gs of Gong et al., linear and exact."""

from avionics.pos.compiled import Array, compiled
from avionics.pos.difference_model import (
    RATE,
    RHO,
    THETA,
    Layout,
    Switches,
    linear_innovation,
    put,
    put_identity,
)
from avionics.pos.rotations import (
    cross_matrix,
    multiply,
    multiply_transposed,
    right_jacobian_of,
    rotation,
    rotation_vector,
)


@compiled
def gyro_rows(
    x: Array,
    rate_m: Array,
    rate_s: Array,
    dt: float,
    at: Layout,
    how: Switches,
    H: Array,
    y: Array,
    A: Array,
) -> None:
    """Write measurement matrix and innovation of the gyro difference.

    Parameters
    ----------
    x : ndarray, shape (n,)
        State.
    rate_m, rate_s : ndarray, shape (3,)
        Gyro outputs, rad/s.
    dt : float
        Step, s.
    at, how : Layout, Switches
        The variant.
    H, y : ndarray, shapes (3, n), (3,)
        Written: measurement matrix and innovation.
    A : ndarray, shape (9, 3, 3)
        Scratch.

    Notes
    -----
    Gong et al., Eq. 15-18, with output = truth + error throughout. Integrating gyros measure
    log(exp(-u_(k-1)) exp(w dt) exp(u_k)) / dt.
    """
    u, w = A[0, 0], A[0, 1]
    H[:, :] = 0.0
    for i in range(3):
        u[i] = x[RHO + i] + x[THETA + i]
        w[i] = rate_m[i]
    if how.nonlinear:
        for i in range(3):
            w[i] -= x[at.gyro_bias_m + i]
        if how.integrating:
            _exact_increment(u, w, x, dt, at, H, y, A)
        else:
            _exact_rate(u, w, x, at, H, y, A)
        for i in range(3):
            y[i] = rate_s[i] - (y[i] + x[at.gyro_bias_s + i])
    else:
        cross_matrix(w, A[1])
        put(H, RHO, A[1], 1.0)
        put(H, THETA, A[1], 1.0)
        put_identity(H, at.gyro_bias_m, -1.0)
        if at.d_theta >= 0:
            put(H, at.d_theta, A[1], -0.5)
            put_identity(H, at.d_theta, 1.0 / dt)
        else:
            put_identity(H, RATE, 1.0)
        put_identity(H, at.gyro_bias_s, 1.0)
        linear_innovation(x, rate_s, rate_m, H, y)
        return
    put_identity(H, at.gyro_bias_s, 1.0)


@compiled
def _exact_increment(
    u: Array, w: Array, x: Array, dt: float, at: Layout, H: Array, y: Array, A: Array
) -> None:
    """Rotation vector of the slave over the step, by dt, and its derivatives."""
    before, turn = A[1, 0], A[1, 1]
    for i in range(3):
        before[i] = u[i] - x[at.d_theta + i]
        turn[i] = w[i] * dt
    rotation(before, A[2])
    rotation(turn, A[3])
    multiply_transposed(A[2], A[3], A[4])
    rotation(u, A[2])
    multiply(A[4], A[2], A[3])  # slave at k-1 from slave at k
    rotation_vector(A[3], turn)
    for i in range(3):
        y[i] = turn[i] / dt
        before[i] = u[i] - 0.5 * x[at.d_theta + i]
    _angle_derivative(before, w, at, H, A)
    put(H, at.d_theta, A[5], -0.5)
    put(H, at.d_theta, A[3], 1.0 / dt)
    if at.force_bias_m >= 0:
        for i in range(3):
            turn[i] = 0.5 / dt * x[at.d_theta + i]
        cross_matrix(turn, A[4])
        put(H, RHO, A[4], 1.0)
        put(H, THETA, A[4], 1.0)
        put(H, at.d_theta, A[4], -0.5)


@compiled
def _exact_rate(u: Array, w: Array, x: Array, at: Layout, H: Array, y: Array, A: Array) -> None:
    """Rate of the slave, exp(u)^T w + J_r(u) theta_dot, and its derivatives."""
    turned = A[1, 1]
    _angle_derivative(u, w, at, H, A)
    for i in range(3):
        y[i] = turned[i]
        for j in range(3):
            y[i] += A[3, i, j] * x[RATE + j]
    put(H, RATE, A[3], 1.0)


@compiled
def _angle_derivative(u: Array, w: Array, at: Layout, H: Array, A: Array) -> None:
    """Write derivatives by u and the master's bias; leave exp(u)^T w in A[1, 1], J_r in A[3].

    The part by which the angle turns the flexure rate, half of [theta_dot x], is not here. With
    gyros alone it is left out and its effect counted as noise (``second_order_variance``): it
    holds the noise that drives the flexure, and a Gauss-Newton filter that sees it takes the
    rotation of that noise for information on the angle, which it is not. Accelerometers observe
    the flexure itself; beside them the part is true information and is put back.
    """
    turned = A[1, 1]
    rotation(u, A[2])
    right_jacobian_of(u, A[3])
    for i in range(3):
        turned[i] = A[2, 0, i] * w[0] + A[2, 1, i] * w[1] + A[2, 2, i] * w[2]
        for j in range(3):
            A[6, i, j] = A[2, j, i]
    cross_matrix(turned, A[4])
    multiply(A[4], A[3], A[5])
    put(H, RHO, A[5], 1.0)
    put(H, THETA, A[5], 1.0)
    put(H, at.gyro_bias_m, A[6], -1.0)
