"""Attitude arithmetic against scipy, finite differences, and its compiled twin."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from avionics.pos import rotations
from avionics.pos.attitude import (
    dcm_from_euler,
    euler_difference_matrix,
    euler_from_dcm,
    right_jacobian,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)

ANGLES = np.array([[0.7, 0.1, -0.2], [-2.9, -0.4, 0.6], [3.1, 0.0, 0.0], [0.0, 0.3, 1.2]])
VECTORS = np.array([[0.2, -0.1, 0.3], [1e-6, 2e-6, -1e-6], [0.0, 0.0, 0.0], [1.0, 1.5, -1.2]])


def test_dcm_is_the_product_of_the_three_turns() -> None:
    for psi, theta, gamma in ANGLES:
        turns = (
            Rotation.from_euler("z", -psi)
            * Rotation.from_euler("x", theta)
            * Rotation.from_euler("y", gamma)
        )
        found = dcm_from_euler(np.array(psi), np.array(theta), np.array(gamma))
        np.testing.assert_allclose(found, turns.as_matrix(), atol=1e-15)


def test_forward_axis_points_along_heading_and_pitch() -> None:
    C = dcm_from_euler(np.array(np.pi / 2), np.array(0.1), np.array(0.0))
    np.testing.assert_allclose(C[:, 1], [np.cos(0.1), 0.0, np.sin(0.1)], atol=1e-15)


def test_positive_roll_lowers_the_right_wing() -> None:
    C = dcm_from_euler(np.array(0.3), np.array(0.0), np.array(0.2))
    assert C[2, 0] < 0.0


def test_euler_angles_come_back() -> None:
    found = euler_from_dcm(dcm_from_euler(*ANGLES.T))
    np.testing.assert_allclose(found, ANGLES, atol=1e-14)


def test_M_is_the_derivative_of_euler_angles_by_a_turn_in_n() -> None:
    for psi, theta, gamma in ANGLES[:3]:
        C = dcm_from_euler(np.array(psi), np.array(theta), np.array(gamma))
        step = 1e-6
        columns = [
            (
                euler_from_dcm(rotation_from_vector(step * e) @ C)
                - euler_from_dcm(rotation_from_vector(-step * e) @ C)
            )
            / (2 * step)
            for e in np.eye(3)
        ]
        found = euler_difference_matrix(np.array(psi), np.array(theta))
        np.testing.assert_allclose(found, np.stack(columns, axis=-1), atol=1e-8)


def test_exponential_and_logarithm_are_scipys() -> None:
    C = rotation_from_vector(VECTORS)
    np.testing.assert_allclose(C, Rotation.from_rotvec(VECTORS).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(vector_from_rotation(C), VECTORS, atol=1e-14)


def test_right_jacobian_is_the_derivative_of_the_exponential() -> None:
    step = 1e-6
    for u in VECTORS:
        C = rotation_from_vector(u)
        columns = [
            vector_from_rotation(
                rotation_from_vector(u - step * e).T @ rotation_from_vector(u + step * e)
            )
            / (2 * step)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(right_jacobian(u), np.stack(columns, -1), atol=1e-8)
        np.testing.assert_allclose(C @ right_jacobian(u), right_jacobian(-u), atol=1e-13)


def test_skew_is_the_cross_product() -> None:
    a, b = VECTORS[0], VECTORS[3]
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-16)


@pytest.mark.parametrize("u", list(VECTORS))
def test_compiled_rotations_equal_the_array_ones(u: np.ndarray) -> None:
    out, vector = np.empty((3, 3)), np.empty(3)
    rotations.rotation(u, out)
    np.testing.assert_allclose(out, rotation_from_vector(u), atol=2e-16 * 8)
    rotations.rotation_vector(out, vector)
    np.testing.assert_allclose(vector, u, atol=1e-14)
    rotations.right_jacobian_of(u, out)
    np.testing.assert_allclose(out, right_jacobian(u), atol=1e-13)
    rotations.cross_matrix(u, out)
    np.testing.assert_array_equal(out, skew(u))


def test_compiled_products_equal_numpys() -> None:
    rng = np.random.default_rng(0)
    A, B, out = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), np.empty((3, 3))
    rotations.multiply(A, B, out)
    np.testing.assert_allclose(out, A @ B, atol=1e-15)
    rotations.multiply_transposed(A, B, out)
    np.testing.assert_allclose(out, A.T @ B, atol=1e-15)
