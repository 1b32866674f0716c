import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.flight.filter_setup import pinhole_from_config
from avionics.wse.attitude import camera_attitude
from avionics.wse.jacobian import complex_step
from avionics.wse.pinhole import Lens, Pinhole, opencv_pose
from tests.avionics.wse.flight import CAMERA, project

POINTS = np.array([[0.1, 0.6, 0.05], [-0.1, 1.2, 0.3], [0.05, 1.5, -0.2], [0.12, 1.4, 0.5]])


def test_eq13_with_distortion_is_what_opencv_projects() -> None:
    camera = pinhole_from_config(CAMERA)
    rotation, translation = opencv_pose(camera)
    lens = camera.lens
    matrix = np.array([[lens.f_x, 0, lens.c_x], [0, lens.f_y, lens.c_y], [0, 0, 1.0]])
    coefficients = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    expected, _ = cv2.projectPoints(
        POINTS, cv2.Rodrigues(rotation)[0], translation, matrix, coefficients
    )
    assert_allclose(camera.project(POINTS), expected[:, 0], atol=1e-9)


def test_projection_agrees_with_one_written_out_apart() -> None:
    assert_allclose(pinhole_from_config(CAMERA).project(POINTS), project(CAMERA, POINTS), atol=1e-9)


def test_camera_at_zero_angles_looks_right_and_sees_aft_to_the_right() -> None:
    D = camera_attitude(0.0, 0.0, 0.0)
    assert_allclose(D @ [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], atol=1e-15)
    assert_allclose(D @ [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    assert_allclose(D @ [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], atol=1e-15)


def test_negative_tilt_looks_down() -> None:
    axis = camera_attitude(0.0, np.radians(-14.0), 0.0)[0]
    assert axis[2] == pytest.approx(np.sin(np.radians(14.0)))


def test_points_behind_or_beyond_the_lens_law_are_not_seen() -> None:
    lens = Lens(600, 600, 320, 240, k1=-0.3)
    # x (1 - 0.3 x^2) turns back at x^2 = 1 / 0.9.
    assert lens.fold_radius() == pytest.approx(1 / 0.9)
    assert Lens(600, 600, 320, 240, k1=0.1).fold_radius() == np.inf
    camera = Pinhole(lens, camera_attitude(0, 0, 0), np.zeros(3), 640, 480, lens.fold_radius())
    seen = camera.can_see(np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.5, 1.0, 0.0]]))
    assert seen.tolist() == [True, False, False]


def test_image_borders_are_pixel_edges() -> None:
    camera = pinhole_from_config(CAMERA)
    pixels = np.array([[-0.4, 0.0], [-0.6, 0.0], [639.4, 479.4], [639.6, 10.0]])
    assert camera.in_image(pixels).tolist() == [True, False, True, False]


def test_projection_is_complex_step_safe() -> None:
    camera = pinhole_from_config(CAMERA)
    _, J = complex_step(camera.project, POINTS[1])
    h = 1e-6
    numeric = [
        (camera.project(POINTS[1] + h * e) - camera.project(POINTS[1] - h * e)) / (2 * h)
        for e in np.eye(3)
    ]
    assert_allclose(J, np.array(numeric).T, atol=1e-6)
