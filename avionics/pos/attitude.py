"""Attitude arithmetic over whole time histories; arrays broadcast over leading axes."""

import numpy as np

from avionics.pos.compiled import Array

SMALL_ANGLE = 1e-4  # rad; below it the series to sixth order is exact to rounding


def dcm_from_euler(psi: Array, theta: Array, gamma: Array) -> Array:
    """Return C_b^n of heading, pitch and roll.

    Parameters
    ----------
    psi, theta, gamma : ndarray, shape (...)
        Heading clockwise from north, pitch nose up, roll right wing down, rad.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Rz(-psi) Rx(theta) Ry(gamma): right-forward-up to East-North-Up.
    """
    s_psi, c_psi, s_theta, c_theta = np.sin(psi), np.cos(psi), np.sin(theta), np.cos(theta)
    s_gamma, c_gamma = np.sin(gamma), np.cos(gamma)
    rows = [
        [
            c_gamma * c_psi + s_gamma * s_psi * s_theta,
            s_psi * c_theta,
            s_gamma * c_psi - c_gamma * s_psi * s_theta,
        ],
        [
            -c_gamma * s_psi + s_gamma * c_psi * s_theta,
            c_psi * c_theta,
            -s_gamma * s_psi - c_gamma * c_psi * s_theta,
        ],
        [-s_gamma * c_theta, s_theta, c_gamma * c_theta],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def euler_from_dcm(D_n_from_b: Array) -> Array:
    """Return (psi, theta, gamma), rad, shape (..., 3), of C_b^n, shape (..., 3, 3)."""
    psi = np.arctan2(D_n_from_b[..., 0, 1], D_n_from_b[..., 1, 1])
    theta = np.arcsin(np.clip(D_n_from_b[..., 2, 1], -1.0, 1.0))
    gamma = np.arctan2(-D_n_from_b[..., 2, 0], D_n_from_b[..., 2, 2])
    return np.stack([psi, theta, gamma], axis=-1)


def euler_difference_matrix(psi: Array, theta: Array) -> Array:
    """Return M: a small rotation in n, rad, to differences of (psi, theta, gamma), rad.

    Parameters
    ----------
    psi, theta : ndarray, shape (...)
        Heading and pitch, rad.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Notes
    -----
    Gong et al., the block behind H1 and H2 of their Eq. 6. Singular at a pitch of 90 deg.
    """
    s, c, zero = np.sin(psi), np.cos(psi), np.zeros_like(psi)
    tan, sec = np.tan(theta), 1.0 / np.cos(theta)
    rows = [[tan * s, tan * c, zero - 1.0], [c, -s, zero], [s * sec, c * sec, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def skew(a: Array) -> Array:
    """Return [a x], shape (..., 3, 3), so that ``skew(a) @ b`` is a x b."""
    zero = np.zeros_like(a[..., 0])
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_from_vector(u: Array) -> Array:
    """Return exp(u x), shape (..., 3, 3), of rotation vectors u, rad, shape (..., 3)."""
    angle2 = np.sum(u * u, axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    is_small = angle < SMALL_ANGLE
    safe = np.where(is_small, 1.0, angle)
    first = np.where(is_small, 1.0 - angle2 / 6.0, np.sin(safe) / safe)
    second = np.where(is_small, 0.5 - angle2 / 24.0, 2.0 * (np.sin(0.5 * safe) / safe) ** 2)
    cross = skew(u)
    result: Array = np.eye(3) + first * cross + second * (cross @ cross)
    return result


def vector_from_rotation(C: Array) -> Array:
    """Return the rotation vector, rad, shape (..., 3), of rotations below 170 deg."""
    twice = np.stack(
        [
            C[..., 2, 1] - C[..., 1, 2],
            C[..., 0, 2] - C[..., 2, 0],
            C[..., 1, 0] - C[..., 0, 1],
        ],
        axis=-1,
    )
    sine = 0.5 * np.sqrt(np.sum(twice * twice, axis=-1))
    cosine = 0.5 * (np.trace(C, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    is_small = sine < SMALL_ANGLE
    ratio = np.where(is_small, 1.0 + sine**2 / 6.0, angle / np.where(is_small, 1.0, sine))
    result: Array = 0.5 * ratio[..., None] * twice
    return result


def right_jacobian(u: Array) -> Array:
    """Return J_r(u), shape (..., 3, 3): exp(u + d) = exp(u) exp(J_r d) to first order in d."""
    angle2 = np.sum(u * u, axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    is_small = angle < 1e-3
    safe = np.where(is_small, 1.0, angle)
    first = np.where(is_small, 0.5 - angle2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(is_small, 1.0 / 6.0 - angle2 / 120.0, (safe - np.sin(safe)) / safe**3)
    cross = skew(u)
    result: Array = np.eye(3) - first * cross + second * (cross @ cross)
    return result
