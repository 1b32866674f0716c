"""What a chip on the wing feels: the wing's truth turned into the sensor's own axes."""

import numpy as np
from numpy.typing import NDArray

from avionics.config import Pod, RootImu
from sim_bus.wing.sim_wing import SimWing

FloatArray = NDArray[np.float64]
# North, east, down; middle latitudes.
EARTH_FIELD_T = np.array([2.0e-5, 1.0e-6, 4.5e-5])


class PodMotion:
    """The motion of one pod; a ``bno055_sensing.Motion``.

    Parameters
    ----------
    wing : SimWing
        The wing.
    pod : Pod
        Station and sensor-to-local rotation.
    """

    def __init__(self, wing: SimWing, pod: Pod) -> None:
        self._wing = wing
        self._s_m = np.array([pod.s_m])
        self._sensor_from_local = np.array(pod.R_sensor_from_local, dtype=np.float64)

    def sense(self, t_ns: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angular rate (rad/s), specific force (m/s^2) and flux (T), each (n, 3)."""
        found = self._wing.stations(t_ns, self._s_m)
        to_sensor = self._sensor_from_local.T
        field_in_body = self._wing.body_from_earth(t_ns) @ EARTH_FIELD_T
        field = np.einsum("nji,nj->ni", found.D_body_from_local[:, 0], field_in_body)
        return (
            found.rate_rad_s[:, 0] @ to_sensor,
            found.specific_force_m_s2[:, 0] @ to_sensor,
            field @ to_sensor,
        )

    def attitudes(self, t_ns: NDArray[np.int64]) -> FloatArray:
        """Return the direction cosine matrices, north-east-down to sensor, shape (n, 3, 3)."""
        body_from_local = self._wing.stations(t_ns, self._s_m).D_body_from_local[:, 0]
        local_from_earth = body_from_local.transpose(0, 2, 1) @ self._wing.body_from_earth(t_ns)
        return np.asarray(self._sensor_from_local @ local_from_earth)

    def attitude(self, t_ns: int) -> FloatArray:
        """Return the direction cosine matrix, north-east-down to sensor."""
        at = np.array([t_ns], dtype=np.int64)
        local_from_body = self._wing.stations(at, self._s_m).D_body_from_local[0, 0].T
        body_from_earth = self._wing.body_from_earth(at)[0]
        return np.asarray(self._sensor_from_local @ local_from_body @ body_from_earth)


class RootSensor:
    """The motion of the root; a ``bno055_sensing.Motion``.

    Parameters
    ----------
    wing : SimWing
        One of the wings at this root.
    imu : RootImu
        Its sensor-to-body rotation.
    """

    def __init__(self, wing: SimWing, imu: RootImu) -> None:
        self._wing = wing
        self._sensor_from_body = np.array(imu.R_sensor_from_body, dtype=np.float64)

    def sense(self, t_ns: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angular rate (rad/s), specific force (m/s^2) and flux (T), each (n, 3)."""
        found = self._wing.stations(t_ns, np.zeros(1))
        to_body, to_sensor = found.D_body_from_local[:, 0], self._sensor_from_body.T
        return (
            np.einsum("nij,nj->ni", to_body, found.rate_rad_s[:, 0]) @ to_sensor,
            np.einsum("nij,nj->ni", to_body, found.specific_force_m_s2[:, 0]) @ to_sensor,
            self._wing.body_from_earth(t_ns) @ EARTH_FIELD_T @ to_sensor,
        )

    def attitude(self, t_ns: int) -> FloatArray:
        """Return the direction cosine matrix, north-east-down to sensor."""
        body_from_earth = self._wing.body_from_earth(np.array([t_ns], dtype=np.int64))[0]
        return np.asarray(self._sensor_from_body @ body_from_earth)
