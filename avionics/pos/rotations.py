"""Compiled 3 x 3 rotation arithmetic for the loops over time; results go into given arrays."""

import numpy as np

from avionics.pos.compiled import Array, compiled


@compiled
def cross_matrix(a: Array, out: Array) -> None:
    """Write [a x] into ``out``, shape (3, 3)."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -a[2], a[1], -a[0]
    out[1, 0], out[2, 0], out[2, 1] = a[2], -a[1], a[0]


@compiled
def multiply(A: Array, B: Array, out: Array) -> None:
    """Write A B into ``out``, shapes (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@compiled
def multiply_transposed(A: Array, B: Array, out: Array) -> None:
    """Write A^T B into ``out``, shapes (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]


@compiled
def _series(u: Array, a: float, b: float, out: Array) -> None:
    """Write I + a [u x] + b [u x]^2."""
    x, y, z = u[0], u[1], u[2]
    out[0, 0] = 1.0 - b * (y * y + z * z)
    out[1, 1] = 1.0 - b * (x * x + z * z)
    out[2, 2] = 1.0 - b * (x * x + y * y)
    out[0, 1], out[1, 0] = b * x * y - a * z, b * x * y + a * z
    out[0, 2], out[2, 0] = b * x * z + a * y, b * x * z - a * y
    out[1, 2], out[2, 1] = b * y * z - a * x, b * y * z + a * x


@compiled
def rotation(u: Array, out: Array) -> None:
    """Write exp(u x) into ``out``."""
    angle2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    angle = np.sqrt(angle2)
    if angle < 1e-4:
        _series(u, 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0, out)
    else:
        half = np.sin(0.5 * angle) / angle
        _series(u, np.sin(angle) / angle, 2.0 * half * half, out)


@compiled
def right_jacobian_of(u: Array, out: Array) -> None:
    """Write J_r(u) into ``out``."""
    angle2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    if angle2 < 1e-6:
        _series(u, -0.5 + angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0, out)
    else:
        angle = np.sqrt(angle2)
        half = np.sin(0.5 * angle) / angle
        _series(u, -2.0 * half * half, (angle - np.sin(angle)) / (angle * angle2), out)


@compiled
def rotation_vector(C: Array, out: Array) -> None:
    """Write the rotation vector of C, below 170 deg, into ``out``, shape (3,)."""
    x, y, z = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]
    sine = 0.5 * np.sqrt(x * x + y * y + z * z)
    if sine < 1e-4:
        ratio = 1.0 + sine * sine / 6.0
    else:
        ratio = np.arctan2(sine, 0.5 * (C[0, 0] + C[1, 1] + C[2, 2] - 1.0)) / sine
    out[0], out[1], out[2] = 0.5 * ratio * x, 0.5 * ratio * y, 0.5 * ratio * z
