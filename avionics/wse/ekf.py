"""The filter algebra: filterpy's extended Kalman filter, used on the error state."""

from typing import Any

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

Array = NDArray[Any]


class ErrorStateEkf:
    """Eqs. 11 and 16 of Srikanth et al. on an error state that is zero between the steps.

    The only module that knows filterpy. It keeps no memory: covariances go in and come out.

    Parameters
    ----------
    states : int
        Length of the error state.
    """

    def __init__(self, states: int) -> None:
        self._ekf = ExtendedKalmanFilter(dim_x=states, dim_z=2)
        self._zero = np.zeros(states)

    def predict(self, P: Array, F: Array, Q: Array) -> Array:
        """Return F P F^T + Q, exactly symmetric."""
        ekf = self._ekf
        ekf.x, ekf.P, ekf.F, ekf.Q = self._zero, P, F, Q
        ekf.predict()
        predicted: Array = ekf.P
        return 0.5 * (predicted + predicted.T)

    def update(self, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array, float]:
        """Return the correction, the covariance after it and y^T S^-1 y.

        Parameters
        ----------
        P : ndarray, shape (n, n)
            Covariance before.
        y : ndarray, shape (m,)
            Innovation z - z(x).
        H : ndarray, shape (m, n)
            Measurement Jacobian.
        R : ndarray, shape (m, m)
            Measurement covariance.

        Notes
        -----
        Joseph form. The caller moves the correction into the state, which resets the error.
        """
        ekf = self._ekf
        ekf.x, ekf.P = self._zero, P
        ekf.update(y, lambda _: H, lambda _: np.zeros_like(y), R=R)
        nis = float(ekf.y @ ekf.SI @ ekf.y)
        after: Array = ekf.P
        return ekf.x, 0.5 * (after + after.T), nis
