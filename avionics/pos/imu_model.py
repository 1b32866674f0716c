"""Strapdown of the slave, its error dynamics and the matching rows of the method IMU."""

import numpy as np

from avionics.pos import earth
from avionics.pos.compiled import Array, compiled
from avionics.pos.rotations import (
    multiply,
    multiply_transposed,
    right_jacobian_of,
    rotation,
    rotation_vector,
)

PHI, VELOCITY, POSITION, BIAS_G, BIAS_F, RHO, THETA, RATE = range(0, 24, 3)
SIZE = 24


@compiled
def strapdown(
    C: Array,
    V: Array,
    position: Array,
    rate: Array,
    force: Array,
    bias: Array,
    dt: float,
    force_n: Array,
    A: Array,
) -> None:
    """Advance attitude, velocity and position by one step, in place.

    Parameters
    ----------
    C : ndarray, shape (3, 3)
        C_s^n.
    V, position : ndarray, shape (3,)
        m/s; latitude, longitude, rad, and height, m.
    rate, force : ndarray, shape (3,)
        Mean sensor outputs over the step, rad/s, m/s^2.
    bias : ndarray, shape (6,)
        Estimated gyro and accelerometer biases, taken off.
    dt : float
        Step, s.
    force_n : ndarray, shape (3,)
        Result: the specific force in n, m/s^2.
    A : ndarray, shape (6, 3, 3)
        Scratch.
    """
    L, h = position[0], position[2]
    north, east = earth.meridian_radius(L) + h, earth.normal_radius(L) + h
    g = earth.gravity(L, h)
    turn, old = A[0, 0], A[0, 1]
    for i in range(3):
        turn[i] = (rate[i] - bias[i]) * dt
        old[i] = V[i]
    rotation(turn, A[1])
    multiply(C, A[1], A[2])
    middle = A[0, 2]
    for i in range(3):
        middle[i] = V[i]
    for stage in range(2):
        _minus_frame_turn(middle, L, north, east, dt, turn)
        rotation(turn, A[3])
        multiply(A[3], A[2], A[4])
        for i in range(3):
            force_n[i] = 0.0
            for j in range(3):
                force_n[i] += 0.5 * (C[i, j] + A[4, i, j]) * (force[j] - bias[3 + j])
        x = -middle[1] / north
        y = 2.0 * earth.EARTH_RATE * np.cos(L) + middle[0] / east
        z = 2.0 * earth.EARTH_RATE * np.sin(L) + middle[0] * np.tan(L) / east
        part = dt if stage == 1 else 0.5 * dt
        V_E = old[0] + part * (force_n[0] - (y * middle[2] - z * middle[1]))
        V_N = old[1] + part * (force_n[1] - (z * middle[0] - x * middle[2]))
        V_U = old[2] + part * (force_n[2] - (x * middle[1] - y * middle[0]) - g)
        if stage == 0:
            middle[0], middle[1], middle[2] = V_E, V_N, V_U
        else:
            V[0], V[1], V[2] = V_E, V_N, V_U
    for i in range(3):
        for j in range(3):
            C[i, j] = A[4, i, j]
    position[0] += dt * 0.5 * (old[1] + V[1]) / north
    position[1] += dt * 0.5 * (old[0] + V[0]) / (east * np.cos(L))
    position[2] += dt * 0.5 * (old[2] + V[2])


@compiled
def _minus_frame_turn(V: Array, L: float, north: float, east: float, dt: float, out: Array) -> None:
    """Write -omega_in dt."""
    out[0] = dt * V[1] / north
    out[1] = -dt * (earth.EARTH_RATE * np.cos(L) + V[0] / east)
    out[2] = -dt * (earth.EARTH_RATE * np.sin(L) + V[0] * np.tan(L) / east)


@compiled
def error_dynamics(D: Array, C: Array, f: Array, V: Array, position: Array, dt: float) -> None:
    """Write F dt of attitude, velocity and position errors into the first nine rows of D.

    Parameters
    ----------
    D : ndarray, shape (24, 24)
        Transition minus identity.
    C : ndarray, shape (3, 3)
        C_s^n.
    f, V : ndarray, shape (3,)
        Specific force and velocity in n, m/s^2, m/s.
    position : ndarray, shape (3,)
        Latitude, longitude, rad; height, m.
    dt : float
        Step, s.

    Notes
    -----
    Gong et al., Eq. 2, with -C eps (printed with +) and the free-air term 2 g dh / R.
    """
    L, h = position[0], position[2]
    north, east = earth.meridian_radius(L) + h, earth.normal_radius(L) + h
    s, c, tan = np.sin(L), np.cos(L), np.tan(L)
    V_E, V_N, V_U = V[0], V[1], V[2]
    ie_N, ie_U = earth.EARTH_RATE * c, earth.EARTH_RATE * s
    en_E, en_N, en_U = -V_N / north, V_E / east, V_E * tan / east
    rate_L = V_E / (east * c * c)
    north_h, east_h, up_h = V_N / north**2, -V_E / east**2, -V_E * tan / east**2

    in_N, in_U = ie_N + en_N, ie_U + en_U
    D[0, 1], D[0, 2], D[0, 4], D[0, 8] = in_U, -in_N, -1.0 / north, north_h
    D[1, 0], D[1, 2], D[1, 3], D[1, 6], D[1, 8] = -in_U, en_E, 1.0 / east, -ie_U, east_h
    D[2, 0], D[2, 1], D[2, 3], D[2, 6], D[2, 8] = in_N, -en_E, tan / east, ie_N + rate_L, up_h

    two_N, two_U = 2.0 * ie_N + en_N, 2.0 * ie_U + en_U
    by_L_N, by_L_U = -2.0 * ie_U, 2.0 * ie_N + rate_L
    D[3, 1], D[3, 2] = -f[2], f[1]
    D[4, 0], D[4, 2] = f[2], -f[0]
    D[5, 0], D[5, 1] = -f[1], f[0]
    D[3, 3] = V_N * tan / east - V_U / east
    D[3, 4], D[3, 5] = two_U, -two_N
    D[3, 6], D[3, 8] = V_N * by_L_U - V_U * by_L_N, V_N * up_h - V_U * east_h
    D[4, 3] = -two_U - V_E * tan / east
    D[4, 4], D[4, 5] = -V_U / north, en_E
    D[4, 6], D[4, 8] = -V_E * by_L_U, V_U * north_h - V_E * up_h
    D[5, 3], D[5, 4] = two_N + V_E / east, -en_E + V_N / north
    D[5, 6] = V_E * by_L_N
    D[5, 8] = V_E * east_h - V_N * north_h + 2.0 * earth.gravity(L, h) / earth.EQUATOR_RADIUS

    D[6, 4], D[6, 8] = 1.0 / north, -north_h
    D[7, 3], D[7, 6], D[7, 8] = 1.0 / (east * c), V_E * tan / (east * c), east_h / c
    D[8, 5] = 1.0
    for i in range(3):
        for j in range(3):
            D[PHI + i, BIAS_G + j] = -C[i, j]
            D[VELOCITY + i, BIAS_F + j] = C[i, j]
    for i in range(9):
        for j in range(15):
            D[i, j] *= dt


def dynamics_places() -> Array:
    """Return a matrix that is not zero wherever ``error_dynamics`` may write."""
    D, ones = np.zeros((SIZE, SIZE)), np.ones(3)
    for _ in range(2):
        error_dynamics(D, np.ones((3, 3)), ones, 100.0 * ones, np.array([0.7, 0.2, 500.0]), 1.0)
    return np.abs(D)


@compiled
def measurement_rows(
    C: Array,
    V: Array,
    flex: Array,
    euler: Array,
    C_m: Array,
    V_ref: Array,
    M: Array,
    arm: Array,
    nonlinear: bool,
    H: Array,
    y: Array,
    A: Array,
) -> None:
    """Write measurement matrix and innovation of velocity and attitude matching.

    Parameters
    ----------
    C, V : ndarray, shapes (3, 3), (3,)
        The slave's computed attitude and velocity.
    flex : ndarray, shape (9,)
        Estimates of rho, theta, theta_dot.
    euler, C_m : ndarray, shapes (3,), (3, 3)
        The master's measured attitude.
    V_ref : ndarray, shape (3,)
        The master's velocity with that of the rigid arm, m/s.
    M : ndarray, shape (3, 3)
        Rotation in n to Euler differences.
    arm : ndarray, shape (3, 3)
        [r0 x], or zero where the arm's flexing is not modelled.
    nonlinear : bool
        See ``ImuOptions``.
    H, y : ndarray, shapes (6, 24), (6,)
        Written: measurement matrix and innovation.
    A : ndarray, shape (6, 3, 3)
        Scratch.

    Notes
    -----
    Gong et al., Eq. 5-8; M of the specification, Sec. 4.
    """
    H[:, :] = 0.0
    u = A[0, 0]
    for i in range(3):
        u[i] = flex[i] + flex[3 + i]
    multiply(M, C_m, A[1])
    multiply(C_m, arm, A[5])
    for i in range(3):
        H[i, VELOCITY + i] = 1.0
        y[i] = V[i] - V_ref[i]
        for j in range(3):
            y[i] += A[5, i, j] * flex[6 + j]
            H[i, RATE + j] = -A[5, i, j]
            H[3 + i, PHI + j] = -M[i, j]
    if nonlinear:
        attitude_residual(C, u, C_m, M, y[3:], A)
        right_jacobian_of(u, A[2])
        rotation(u, A[3])
        multiply(A[3], A[2], A[4])
        multiply(A[1], A[4], A[2])
    else:
        y[3] = np.arctan2(C[0, 1], C[1, 1]) - euler[0]
        y[4] = np.arcsin(C[2, 1]) - euler[1]
        y[5] = np.arctan2(-C[2, 0], C[2, 2]) - euler[2]
        for i in range(3):
            y[3 + i] -= 2.0 * np.pi * np.round(y[3 + i] / (2.0 * np.pi))
            for j in range(3):
                y[3 + i] -= A[1, i, j] * u[j]
                A[2, i, j] = A[1, i, j]
    for i in range(3):
        for j in range(3):
            H[3 + i, RHO + j] = A[2, i, j]
            H[3 + i, THETA + j] = A[2, i, j]


@compiled
def attitude_residual(C: Array, u: Array, C_m: Array, M: Array, out: Array, A: Array) -> None:
    """Write M log(C exp(u)^T C_m^T), shape (3,), rad; scratch A[2] to A[4]."""
    rotation(u, A[2])
    for i in range(3):
        for j in range(3):
            A[3, i, j] = A[2, j, i]
            A[4, i, j] = C_m[j, i]
    multiply(C, A[3], A[2])
    multiply(A[2], A[4], A[3])
    between = A[2, 0]
    rotation_vector(A[3], between)
    for i in range(3):
        out[i] = M[i, 0] * between[0] + M[i, 1] * between[1] + M[i, 2] * between[2]


@compiled
def feed_back(
    C: Array, V: Array, position: Array, bias: Array, flex: Array, dx: Array, A: Array
) -> None:
    """Correct the strapdown and the angles by the estimated errors, shape (24,), in place."""
    rotation(dx[PHI : PHI + 3], A[1])
    multiply(A[1], C, A[2])
    # One step of Newton's iteration keeps the product of many rotations orthonormal.
    multiply_transposed(A[2], A[2], A[3])
    for i in range(3):
        for j in range(3):
            A[3, i, j] = -0.5 * A[3, i, j] + (1.5 if i == j else 0.0)
    multiply(A[2], A[3], C)
    for i in range(3):
        V[i] -= dx[VELOCITY + i]
        position[i] -= dx[POSITION + i]
        bias[i] += dx[BIAS_G + i]
        bias[3 + i] += dx[BIAS_F + i]
    for i in range(9):
        flex[i] += dx[RHO + i]
