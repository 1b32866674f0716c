"""The algebra of the extended Kalman filter on an error state that is zero between the steps.

Plain functions: covariances go in and come out. The tests hold both against filterpy, bit for bit.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[Any]


def predict(P: Array, F: Array, Q: Array) -> Array:
    """Return the covariance F P F^T + Q after a step, exactly symmetric.

    Parameters
    ----------
    P, F, Q : ndarray, shape (n, n)
        Covariance before the step, transition of the error state, process noise.

    Notes
    -----
    Srikanth et al., Eq. 11. The error state itself stays zero.
    """
    predicted: Array = F @ P @ F.T + Q
    return 0.5 * (predicted + predicted.T)


def update(P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array, float]:
    """Return the correction of the state, the covariance after it and y^T S^-1 y.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Covariance before the update.
    y : ndarray, shape (m,)
        Innovation z - z(x).
    H : ndarray, shape (m, n)
        Measurement Jacobian.
    R : ndarray, shape (m, m)
        Covariance of the measurement.

    Returns
    -------
    dx : ndarray, shape (n,)
        Correction, K y; the caller adds it to the state, which resets the error to zero.
    P : ndarray, shape (n, n)
        Covariance after the update, exactly symmetric.
    nis : float
        Normalised innovation squared; divide by m to compare it with one.

    Notes
    -----
    Srikanth et al., Eq. 16, with the covariance in Joseph form.
    """
    PHt = P @ H.T
    S_inverse = linalg.inv(H @ PHt + R)  # m is small, and the gain and the NIS share it
    K = PHt @ S_inverse
    I_KH = np.eye(len(P)) - K @ H
    after: Array = I_KH @ P @ I_KH.T + K @ R @ K.T
    return K @ y, 0.5 * (after + after.T), float(y @ S_inverse @ y)
