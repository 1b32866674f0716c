"""Where the camera stands and looks, from markers of known position in its pictures.

Lens and position are strongly correlated over few instants, and every motion-capture marker has
an error of its own that does not average out: both are unknowns here, with what is known of them
as prior, so that the reported covariance is consistent.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from avionics.errors import DataSetError
from avionics.wse.attitude import camera_attitude
from avionics.wse.pinhole import Lens, Pinhole

FloatArray = NDArray[np.float64]

LENS = ("f_x_px", "f_y_px", "c_x_px", "c_y_px", "k1", "k2", "p1", "p2")
POSE = ("x_m", "y_m", "z_m", "roll_deg", "tilt_deg", "pan_deg")
MARKER_SIGMA_M = 5e-4
PIXEL_SIGMA = 0.3
TIME_SIGMA_S = 0.05
LEAST_MEASUREMENTS = 12
# Without a chessboard the lens is known from the data sheet only.
NOMINAL_LENS_SIGMA = {
    "f_x_px": 25.0, "f_y_px": 25.0, "c_x_px": 6.0, "c_y_px": 6.0,
    "k1": 0.1, "k2": 0.05, "p1": 1e-3, "p2": 1e-3,
}  # fmt: skip
POSE_SIGMA = {
    "x_m": 0.05, "y_m": 0.05, "z_m": 0.05, "roll_deg": 5.0, "tilt_deg": 8.0, "pan_deg": 5.0,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class MarkerMeasurements:
    """Markers of known position seen in pictures.

    Attributes
    ----------
    marker : ndarray, shape (n,), int
        Which marker.
    r_in_body_m, speed_m_s : ndarray, shape (n, 3)
        Its position at the picture's stamp, and velocity.
    pixel : ndarray, shape (n, 2)
        Where the picture shows it, raw image, px.
    """

    marker: NDArray[np.int64]
    r_in_body_m: FloatArray
    speed_m_s: FloatArray
    pixel: FloatArray

    def __len__(self) -> int:
        return len(self.marker)


@dataclass(frozen=True, slots=True, eq=False)
class Extrinsics:
    """A calibrated camera.

    Attributes
    ----------
    values, sigma : dict of str to float
        Lens (``f_x_px``, ...), pose (``x_m``, ..., ``pan_deg``) and ``time_offset_s``.
    rms_px : float
        Residual per axis.
    residual_px : ndarray, shape (n, 2)
        Measured minus predicted of every measurement.
    marker_offset_mm : ndarray, shape (markers, 3)
        Estimated errors of the motion-capture markers, body axes.
    """

    values: dict[str, float]
    sigma: dict[str, float]
    rms_px: float
    residual_px: FloatArray
    marker_offset_mm: FloatArray


def camera_of(values: Mapping[str, float], width: int, height: int) -> Pinhole:
    """Return the camera with the parameters of a calibration."""
    lens = Lens(*(values[name] for name in LENS))
    attitude = camera_attitude(
        *(np.radians(values[n]) for n in ("roll_deg", "tilt_deg", "pan_deg"))
    )
    position = np.array([values[n] for n in ("x_m", "y_m", "z_m")])
    return Pinhole(lens, attitude, position, width, height, lens.fold_radius())


def calibrate_pose(
    measurements: MarkerMeasurements,
    nominal: Mapping[str, float],
    lens_sigma: Mapping[str, float],
    size_px: tuple[int, int],
) -> Extrinsics:
    """Return the camera that explains the measured markers.

    Parameters
    ----------
    measurements : MarkerMeasurements
        From many instants over the wing's range; a wrong one costs little.
    nominal : mapping of str to float
        Start values of lens, pose and ``time_offset_s``.
    lens_sigma : mapping of str to float
        How well the lens is known.
    size_px : tuple of int
        Width and height, px.

    Raises
    ------
    DataSetError
        If there are too few measurements.
    """
    if len(measurements) < LEAST_MEASUREMENTS:
        msg = (
            f"calibration: {len(measurements)} measurements of markers, "
            f"at least {LEAST_MEASUREMENTS} "
            "needed; are the lights on and does motion capture cover the video?"
        )
        raise DataSetError(msg)
    names = (*LENS, *POSE, "time_offset_s")
    prior = np.array([*(lens_sigma[n] for n in LENS), *POSE_SIGMA.values(), TIME_SIGMA_S])
    start = np.array([nominal[n] for n in names])
    ids, index = np.unique(measurements.marker, return_inverse=True)
    size = len(names)

    def unpack(x: FloatArray) -> tuple[dict[str, float], FloatArray]:
        values = dict(zip(names, (start + x[:size] * prior).tolist(), strict=True))
        return values, x[size:].reshape(-1, 3) * MARKER_SIGMA_M

    def misfit(x: FloatArray) -> FloatArray:
        values, offsets = unpack(x)
        points = measurements.r_in_body_m - offsets[index]
        points = points + measurements.speed_m_s * values["time_offset_s"]
        predicted = camera_of(values, *size_px).project(points)
        return np.asarray(measurements.pixel - predicted, dtype=np.float64)

    def residuals(x: FloatArray) -> FloatArray:
        pixels = misfit(x).ravel() / PIXEL_SIGMA
        # Huber's weights on the pixels alone; the priors are no measurements that can be wrong.
        size_of = np.abs(pixels)
        linear = np.sign(pixels) * np.sqrt(np.maximum(4.0 * size_of - 4.0, 0.0))
        soft = np.where(size_of > 2.0, linear, pixels)
        return np.concatenate([soft, x])

    solution = least_squares(residuals, np.zeros(size + 3 * len(ids)), x_scale="jac")
    values, offsets = unpack(solution.x)
    jacobian = np.asarray(solution.jac, dtype=np.float64)
    information = jacobian.T @ jacobian
    deviation = np.sqrt(np.diag(np.linalg.inv(information)))[:size] * prior
    residual = misfit(solution.x)
    return Extrinsics(
        values,
        dict(zip(names, deviation.tolist(), strict=True)),
        float(np.sqrt(np.mean(residual**2))),
        residual,
        offsets * 1e3,
    )
