"""The simulated camera's own projection, written apart from the estimator's.

Position and orientation are built from the axes themselves (optical axis, image right, image
down), the lens is Brown's polynomial; no rotation-matrix convention is shared with
``avionics.wse.pinhole``, and a test holds the two against each other.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from avionics.config import Camera

FloatArray = NDArray[np.float64]


@lru_cache(maxsize=64)
def camera_axes(camera: Camera) -> FloatArray:
    """Return optical axis, image right and image down in body axes, as rows, shape (3, 3).

    At zero angles the camera looks along +y (out along the right wing) with image right aft and
    image down down. Pan turns it about the body's down axis (positive: forward to right, that
    is, aft), then tilt about image right (negative looks down), then roll about the optical axis.
    """
    forward, right, down = np.eye(3)

    def turned(vector: FloatArray, about: FloatArray, angle: float) -> FloatArray:
        c, s = np.cos(angle), np.sin(angle)  # Rodrigues
        along = about * (about @ vector) * (1 - c)
        return np.asarray(vector * c + np.cross(about, vector) * s + along)

    axis, image_right, image_down = right, -forward, down
    pan, tilt, roll = np.radians([camera.pan_deg, camera.tilt_deg, camera.roll_deg])
    axis, image_right = turned(axis, down, pan), turned(image_right, down, pan)
    axis, image_down = turned(axis, image_right, tilt), turned(image_down, image_right, tilt)
    image_right, image_down = turned(image_right, axis, roll), turned(image_down, axis, roll)
    axes = np.stack([axis, image_right, image_down])
    axes.flags.writeable = False
    return axes


def project(camera: Camera, r_in_body_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return raw-image pixels and depth.

    Parameters
    ----------
    camera : Camera
        Pose and lens.
    r_in_body_m : ndarray, shape (..., 3)
        Points, body axes, m.

    Returns
    -------
    pixel : ndarray, shape (..., 2)
        Integers are pixel centres; NaN behind the camera.
    depth_m : ndarray, shape (...)
        Along the optical axis.
    """
    seen = (r_in_body_m - np.array(camera.r_in_body_m)) @ camera_axes(camera).T
    depth = seen[..., 0]
    safe = np.where(depth > 1e-6, depth, np.nan)
    x, y = seen[..., 1] / safe, seen[..., 2] / safe
    x, y = distorted(camera, x, y)
    pixel = np.stack([camera.c_x_px + camera.f_x_px * x, camera.c_y_px + camera.f_y_px * y], -1)
    return pixel, depth


def distorted(camera: Camera, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return Brown's distortion of normalised image coordinates."""
    r2 = x * x + y * y
    radial = 1 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3))
    shift_x = 2 * camera.p1 * x * y + camera.p2 * (r2 + 2 * x * x)
    shift_y = camera.p1 * (r2 + 2 * y * y) + 2 * camera.p2 * x * y
    return x * radial + shift_x, y * radial + shift_y


def undistorted_grid(camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return the normalised ray of every pixel, two arrays of shape (H, W)."""
    v, u = np.mgrid[0 : camera.height_px, 0 : camera.width_px].astype(np.float64)
    goal_x = (u - camera.c_x_px) / camera.f_x_px
    goal_y = (v - camera.c_y_px) / camera.f_y_px
    x, y = goal_x.copy(), goal_y.copy()
    for _ in range(30):  # fixed point; contracts for any lens without a fold in the image
        bent_x, bent_y = distorted(camera, x, y)
        x, y = x + goal_x - bent_x, y + goal_y - bent_y
    return x, y
