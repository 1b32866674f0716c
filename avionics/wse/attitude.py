"""Elementary rotations and station attitude, and sines that serve real and complex-step calls."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def sin_cos(angle: Array) -> tuple[Array, Array]:
    """Return sine and cosine of real angles, or of angles stepped for a derivative.

    Notes
    -----
    With the imaginary part b of a complex step, 1e-30 or so, cosh b = 1 and sinh b = b to the last
    bit, so that sin(a + ib) = sin a + ib cos a and cos(a + ib) = cos a - ib sin a: several times
    faster than the library's complex functions.
    """
    if not np.iscomplexobj(angle):
        return np.sin(angle), np.cos(angle)
    sine, cosine = np.empty_like(angle), np.empty_like(angle)
    step, s, c = angle.imag, np.sin(angle.real), np.cos(angle.real)
    sine.real, cosine.real = s, c
    np.multiply(c, step, out=sine.imag)
    np.multiply(s, -step, out=cosine.imag)
    return sine, cosine


def rotation_1(angle: float | Array) -> Array:
    """Return R1, the direction cosine matrix of a turn about the first axis."""
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def rotation_2(angle: float | Array) -> Array:
    """Return R2, the direction cosine matrix of a turn about the second axis."""
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def rotation_3(angle: float | Array) -> Array:
    """Return R3, the direction cosine matrix of a turn about the third axis."""
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def station_attitude(phi: float, theta: float, psi: float) -> Array:
    """Return D_station_from_body = R1(phi) R2(theta) R3(psi), shape (3, 3)."""
    return rotation_1(phi) @ rotation_2(theta) @ rotation_3(psi)


def camera_attitude(roll: float, tilt: float, pan: float) -> Array:
    """Return D_cam_from_body = R1(roll) R2(tilt) R3(pi/2 + pan), shape (3, 3).

    Camera axes: x optical axis, y image right, z image down. At zero angles the camera looks
    along +y of the body and image right is aft; negative tilt looks down. Angles in rad.
    """
    return rotation_1(roll) @ rotation_2(tilt) @ rotation_3(np.pi / 2 + pan)
