"""Gyro kinematics at stations: body rates and angle rates, and the modal inverse."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.attitude import sin_cos

Array = NDArray[Any]


def euler_rate_matrix(phi: Array, theta: Array) -> Array:
    """Map body rates (P, Q, R) to local angle rates.

    Parameters
    ----------
    phi, theta : ndarray, shape (..., M)
        Local bending and twist angles at M stations, rad. May be complex (complex step).

    Returns
    -------
    ndarray, shape (..., M, 3, 3)
        H(phi, theta); rows are the phi, theta and psi rates.

    Raises
    ------
    ValueError
        If the shapes differ.

    Notes
    -----
    Srikanth et al., Eq. 4, with the third row of the in-plane family. Singular at
    abs(theta) = pi/2.
    """
    if phi.shape != theta.shape:
        msg = f"phi has shape {phi.shape}, theta {theta.shape}; wanted equal shapes"
        raise ValueError(msg)
    s_phi, c_phi = sin_cos(phi)
    s_theta, c_theta = sin_cos(theta)
    one, zero = np.ones_like(s_phi), np.zeros_like(s_phi)
    tangent = s_theta / c_theta
    rows = [
        [one, s_phi * tangent, c_phi * tangent],
        [zero, c_phi, -s_phi],
        [zero, s_phi / c_theta, c_phi / c_theta],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def body_rates(phi: Array, theta: Array, rates: Array) -> Array:
    """Return the body rates that a gyro sees: the inverse of ``euler_rate_matrix``.

    Parameters
    ----------
    phi, theta : ndarray, shape (..., M)
        Local angles, rad.
    rates : ndarray, shape (..., M, 3)
        Rates of phi, theta and psi, rad/s.

    Returns
    -------
    ndarray, shape (..., M, 3)
        P, Q, R in the local frame, rad/s.
    """
    s_phi, c_phi = sin_cos(phi)
    s_theta, c_theta = sin_cos(theta)
    d_phi, d_theta, d_psi = rates[..., 0], rates[..., 1], rates[..., 2]
    return np.stack(
        [
            d_phi - d_psi * s_theta,
            d_theta * c_phi + d_psi * c_theta * s_phi,
            -d_theta * s_phi + d_psi * c_theta * c_phi,
        ],
        axis=-1,
    )


def modal_inverse(shapes: Array, prior: Array) -> Array:
    """Return the matrix that turns angle rates at the stations into modal rates.

    Parameters
    ----------
    shapes : ndarray, shape (M, N)
        Phi or Theta: mode shapes at the gyro stations.
    prior : ndarray, shape (N,)
        Prior variances W of the amplitudes, used where there are more modes than stations.

    Returns
    -------
    ndarray, shape (N, M)
        The least-squares inverse of Eq. 7 for M >= N, W Phi^T (Phi W Phi^T)^-1 otherwise; zero
        without stations. Stations that coincide are no error.
    """
    stations, modes = shapes.shape
    if stations == 0 or modes == 0:
        return np.zeros((modes, stations))
    if stations >= modes and np.linalg.matrix_rank(shapes) == modes:
        return np.linalg.pinv(shapes)
    weighted = prior[:, None] * shapes.T
    return weighted @ np.linalg.pinv(shapes @ weighted, rcond=1e-10, hermitian=True)


def turned(
    body: Array, s_phi: Array, c_phi: Array, s_theta: Array, c_theta: Array, *psi: Array
) -> Array:
    """Return D(phi, theta, psi) @ body rate at every station, shape (..., M, 3)."""
    s_psi, c_psi = psi
    p, q, r = body[..., None, 0], body[..., None, 1], body[..., None, 2]
    along = c_psi * p + s_psi * q
    across = c_psi * q - s_psi * p
    lifted = s_theta * along + c_theta * r
    return np.stack(
        [
            c_theta * along - s_theta * r,
            c_phi * across + s_phi * lifted,
            c_phi * lifted - s_phi * across,
        ],
        axis=-1,
    )
