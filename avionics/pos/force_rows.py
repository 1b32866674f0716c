"""Accelerometer rows of the difference filters: As of Gong et al., linear and exact."""

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
from avionics.pos.rotations import cross_matrix, multiply, right_jacobian_of, rotation


@compiled
def force_rows(
    x: Array,
    force_m: Array,
    arm: Array,
    force_s: Array,
    rate: Array,
    rate_dot: Array,
    r0: Array,
    dt: float,
    at: Layout,
    how: Switches,
    H: Array,
    y: Array,
    A: Array,
) -> None:
    """Write measurement matrix and innovation of the accelerometer difference.

    Parameters
    ----------
    x : ndarray, shape (n,)
        State.
    force_m, arm, force_s : ndarray, shape (3,)
        Master's output, acceleration a_r of the rigid arm, slave's output, m/s^2.
    rate, rate_dot : ndarray, shape (3,)
        The master's, rad/s, rad/s^2.
    r0 : ndarray, shape (3,)
        Lever arm, m.
    dt : float
        Step, s.
    at, how : Layout, Switches
        The variant.
    H, y : ndarray, shapes (3, n), (3,)
        Written: measurement matrix and innovation.
    A : ndarray, shape (10, 3, 3)
        Scratch.

    Notes
    -----
    Gong et al., Eq. 24-27. The angle's derivative turns f_m + a_r of the rigid arm only: the
    estimated second derivative of the arm is as noisy as the sensor and correlated with it.
    """
    F, lever = A[0, 0], A[0, 1]
    H[:, :] = 0.0
    for i in range(3):
        F[i] = force_m[i] + arm[i]
    if how.arm_model:
        _arm_blocks(rate, rate_dot, r0, dt, how.integrating, A)
    if how.nonlinear:
        _exact_force(x, F, at, how, H, y, A)
        for i in range(3):
            y[i] = force_s[i] - (y[i] + x[at.force_bias_s + i])
        put_identity(H, at.force_bias_s, 1.0)
        return
    for i in range(3):
        lever[i] = F[i] if how.arm_in_H else force_m[i]
    cross_matrix(lever, A[1])
    put(H, RHO, A[1], 1.0)
    put(H, THETA, A[1], 1.0)
    put(H, at.d_theta, A[1], -0.5)
    if how.arm_model:
        put(H, THETA, A[7], 1.0)
        put(H, RATE, A[8], 1.0)
        put(H, at.d_rate, A[9], 1.0)
    put_identity(H, at.force_bias_m, -1.0)
    put_identity(H, at.force_bias_s, 1.0)
    linear_innovation(x, force_s, F, H, y)


@compiled
def _arm_blocks(
    rate: Array, rate_dot: Array, r0: Array, dt: float, integrating: bool, A: Array
) -> None:
    """Write derivatives of the flexing arm's acceleration by theta, theta_dot and its increment."""
    cross_matrix(rate, A[1])
    cross_matrix(rate_dot, A[2])
    cross_matrix(r0, A[3])
    multiply(A[1], A[3], A[8])
    multiply(A[1], A[8], A[7])
    multiply(A[2], A[3], A[4])
    for i in range(3):
        for j in range(3):
            A[7, i, j] = -A[7, i, j] - A[4, i, j]
            A[9, i, j] = -A[3, i, j] / dt + (A[8, i, j] if integrating else 0.0)
            A[8, i, j] *= -2.0


@compiled
def _exact_force(
    x: Array, F: Array, at: Layout, how: Switches, H: Array, y: Array, A: Array
) -> None:
    """Mean of exp(u)^T (f + a_r) over the step, and its derivatives."""
    u, turned, moved = A[0, 2], A[1, 0], A[1, 1]
    for i in range(3):
        F[i] -= x[at.force_bias_m + i]
        y[i] = 0.0
        moved[i] = F[i]
        if how.arm_model:
            for j in range(3):
                moved[i] += A[7, i, j] * x[THETA + j] + A[8, i, j] * x[RATE + j]
                moved[i] += A[9, i, j] * x[at.d_rate + j]
    ends = 2 if at.d_theta >= 0 else 1
    part = 1.0 / ends
    for end in range(ends):
        for i in range(3):
            u[i] = x[RHO + i] + x[THETA + i] - (x[at.d_theta + i] if end == 1 else 0.0)
        rotation(u, A[2])
        right_jacobian_of(u, A[3])
        for i in range(3):
            turned[i] = A[2, 0, i] * F[0] + A[2, 1, i] * F[1] + A[2, 2, i] * F[2]
            for j in range(3):
                y[i] += part * A[2, j, i] * moved[j]
        cross_matrix(turned, A[4])
        multiply(A[4], A[3], A[5])
        put(H, RHO, A[5], part)
        put(H, THETA, A[5], part)
        if end == 1:
            put(H, at.d_theta, A[5], -part)
        for i in range(3):
            for j in range(3):
                A[6, i, j] = A[2, j, i]
        put(H, at.force_bias_m, A[6], -part)
        if how.arm_model:
            for block in range(3):
                multiply(A[6], A[7 + block], A[4])
                put(H, THETA if block == 0 else (RATE if block == 1 else at.d_rate), A[4], part)
