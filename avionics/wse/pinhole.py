"""The camera: body points to raw-image pixels. The only place that knows OpenCV's lens and axes.

The prediction is distorted; measurements stay as the image shows them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

# OpenCV's camera axes (right, down, forward) from ours (forward, right, down).
OPENCV_FROM_CAMERA = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Lens:
    """Focal lengths and centre, px, and OpenCV's distortion coefficients."""

    f_x: float
    f_y: float
    c_x: float
    c_y: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def pixel(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Return (u, v), px, of the directions a = p_y/p_x, b = p_z/p_x; may be complex.

        Notes
        -----
        Srikanth et al., Eq. 13, with OpenCV's radial and tangential distortion.
        """
        aa, bb, ab = a * a, b * b, a * b
        r2 = aa + bb
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        x = a * radial + 2.0 * self.p1 * ab + self.p2 * (r2 + 2.0 * aa)
        y = b * radial + self.p1 * (r2 + 2.0 * bb) + 2.0 * self.p2 * ab
        return self.c_x + self.f_x * x, self.c_y + self.f_y * y

    def fold_radius(self) -> float:
        """Return the smallest a^2 + b^2 at which the radial law turns back; inf if it never does.

        Directions beyond it would be imaged inside those before it, which no lens does.
        """
        roots = np.roots([7 * self.k3, 5 * self.k2, 3 * self.k1, 1.0])
        real = roots[np.abs(roots.imag) < 1e-9].real
        positive = real[real > 0]
        return float(positive.min()) if positive.size else np.inf


@dataclass(frozen=True, slots=True, eq=False)
class Pinhole:
    """A calibrated camera at the wing root.

    Attributes
    ----------
    lens : Lens
        Intrinsics.
    D_cam_from_body : ndarray, shape (3, 3)
        Attitude.
    r_cam_in_body : ndarray, shape (3,)
        Position, m.
    width, height : int
        Image size, px.
    max_radius : float
        Largest (p_y^2 + p_z^2) / p_x^2 at which the lens law holds.
    """

    lens: Lens
    D_cam_from_body: Array
    r_cam_in_body: Array
    width: int
    height: int
    max_radius: float = np.inf

    def camera_axes(self, r_in_body: Array) -> Array:
        """Return body points (..., 3) in camera axes, m: Eq. 12 of Srikanth et al."""
        return (r_in_body - self.r_cam_in_body) @ self.D_cam_from_body.T

    def project(self, r_in_body: Array) -> Array:
        """Return the raw-image pixels of body points; may be complex (complex step).

        Parameters
        ----------
        r_in_body : ndarray, shape (..., 3)
            Points, m.

        Returns
        -------
        ndarray, shape (..., 2)
            (u, v), px, integers are pixel centres. Meaningless where ``can_see`` is False.
        """
        p = self.camera_axes(r_in_body)
        u, v = self.lens.pixel(p[..., 1] / p[..., 0], p[..., 2] / p[..., 0])
        return np.stack([u, v], axis=-1)

    def can_see(self, r_in_body: Array) -> Array:
        """Return whether points lie before the camera and inside the lens law, shape (...)."""
        p = self.camera_axes(r_in_body)
        return self._is_before(p[..., 0], p[..., 1], p[..., 2])

    def _is_before(self, p_x: Array, p_y: Array, p_z: Array) -> Array:
        return np.asarray((p_x > 0) & (p_y * p_y + p_z * p_z < self.max_radius * p_x * p_x))

    def project_components(self, r_in_body: Array) -> tuple[Array, Array]:
        """Return pixels and visibility of points given by components: the fast path.

        Parameters
        ----------
        r_in_body : ndarray, shape (..., 3, K)
            Components of K points, m; may be complex.

        Returns
        -------
        pixel : ndarray, shape (..., 2, K)
        can_see : ndarray of bool, shape (..., K)
        """
        p = self.D_cam_from_body @ (r_in_body - self.r_cam_in_body[:, None])
        p_x, p_y, p_z = p[..., 0, :], p[..., 1, :], p[..., 2, :]
        pixel = np.empty((*p.shape[:-2], 2, p.shape[-1]), dtype=p.dtype)
        pixel[..., 0, :], pixel[..., 1, :] = self.lens.pixel(p_y / p_x, p_z / p_x)
        return pixel, self._is_before(p_x.real, p_y.real, p_z.real)

    def in_image(self, pixel: Array) -> Array:
        """Return whether pixels (..., 2) lie on the sensor."""
        u, v = pixel[..., 0], pixel[..., 1]
        return np.asarray(
            (u >= -0.5) & (u <= self.width - 0.5) & (v >= -0.5) & (v <= self.height - 0.5)
        )


def opencv_pose(camera: Pinhole) -> tuple[Array, Array]:
    """Return OpenCV's rotation matrix (3, 3) and translation (3,), m, from body to camera axes."""
    rotation = OPENCV_FROM_CAMERA @ camera.D_cam_from_body
    return rotation, -rotation @ camera.r_cam_in_body
