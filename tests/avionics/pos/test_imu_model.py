"""Strapdown, error dynamics and matching rows: numerical derivatives and noise-free runs."""

import numpy as np
import pytest

from avionics.pos import earth
from avionics.pos import imu_model as m
from avionics.pos.attitude import (
    dcm_from_euler,
    euler_difference_matrix,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)
from avionics.pos.simulate import slave_truth
from avionics.pos.trajectory import Trajectory
from tests.avionics.pos.conftest import DT, make_node

A = np.empty((10, 3, 3))
ATTITUDE = dcm_from_euler(np.array(0.7), np.array(0.1), np.array(-0.2))
VELOCITY = np.array([64.0, 76.0, 3.0])
POSITION = np.array([0.7, 2.0, 500.0])
FORCE = np.array([0.3, 0.8, 9.9])
RATE = np.array([0.01, -0.02, 0.03])


def step(C: np.ndarray, V: np.ndarray, p: np.ndarray, bias: np.ndarray, dt: float) -> tuple:
    C, V, p, force_n = C.copy(), V.copy(), p.copy(), np.empty(3)
    m.strapdown(C, V, p, RATE, FORCE, bias, dt, force_n, A)
    return C, V, p, force_n


def test_noise_free_strapdown_follows_the_slave(trajectory: Trajectory) -> None:
    node = make_node()
    theta = np.array([1e-3, 5e-3, 1e-3]) * np.sin(trajectory.t[:, None])
    rate = np.array([1e-3, 5e-3, 1e-3]) * np.cos(trajectory.t[:, None])
    truth, _, _ = slave_truth(trajectory, node, theta, rate, {})
    C, V = truth.D_n_from_s[0].copy(), truth.velocity[0].copy()
    p = np.array([trajectory.latitude[0], trajectory.longitude[0], trajectory.height[0]])
    force_n, zero = np.empty(3), np.zeros(6)
    for k in range(1, len(trajectory.t)):
        m.strapdown(C, V, p, truth.rate[k], truth.force[k], zero, DT, force_n, A)
    tilt = vector_from_rotation(C @ truth.D_n_from_s[-1].T)
    assert np.abs(tilt).max() < 1e-6  # 0.004 arcmin
    assert np.abs(V - truth.velocity[-1]).max() < 2e-3  # a fifteenth of one reference sample
    assert abs(p[0] - trajectory.latitude[-1]) * 6.4e6 < 6.0  # arm of 5 m included


@pytest.mark.parametrize("state", range(15))
def test_error_dynamics_are_the_derivatives_of_the_strapdown(state: int) -> None:
    """Signs and sizes of F, column by column, against one perturbed strapdown step."""
    dt = 0.01
    size = np.repeat([1e-5, 1e-2, 1e-7, 1e-5, 1e-3], 3)[state]
    if state == 8:
        size = 100.0
    dx = np.zeros(15)
    dx[state] = size
    ends = []
    for sign in (1.0, -1.0):
        d = sign * dx
        # phi: C' = (I - phi x) C; biases: output = truth + error, the estimate being zero.
        start = rotation_from_vector(-d[:3]) @ ATTITUDE
        ends.append(step(start, VELOCITY + d[3:6], POSITION + d[6:9], -d[9:15], dt))
    (C1, V1, p1, _), (C2, V2, p2, _) = ends
    nominal, _, _, force_n = step(ATTITUDE, VELOCITY, POSITION, np.zeros(6), dt)
    phi = -vector_from_rotation(C1 @ nominal.T) + vector_from_rotation(C2 @ nominal.T)
    found = np.concatenate([phi, V1 - V2, p1 - p2]) / (2.0 * size)
    D = np.zeros((24, 24))
    m.error_dynamics(D, nominal, force_n, VELOCITY, POSITION, dt)
    expected = D[:9, state].copy()
    if state < 9:
        expected[state] += 1.0
    if state == 6:  # Gong et al. leave out that gravity grows with latitude, 0.05 m/s^2 per rad
        ahead, here = earth.gravity(0.7 + 1e-4, 500.0), earth.gravity(0.7, 500.0)
        expected[5] -= (ahead - here) / 1e-4 * dt
    # First order in dt: the second is 0.5 dt times what the states pass on to each other.
    scale = np.array([1e-5] * 3 + [2e-3 if state < 3 or 9 <= state < 12 else 1e-5] * 3 + [1e-9] * 3)
    if state in (6, 7, 8):
        scale[6:] = 1e-5
    if state in (3, 4, 5, 12, 13, 14):
        scale[8] = 1e-4
    if state in (0, 1, 2, 9, 10, 11):
        scale[8] = 1e-3
    assert np.all(np.abs(found - expected) < scale), found - expected


def test_free_air_term_has_the_sign_of_falling_gravity() -> None:
    D = np.zeros((24, 24))
    m.error_dynamics(D, ATTITUDE, FORCE, np.zeros(3), POSITION, 1.0)
    assert D[5, 8] == pytest.approx(2 * 9.80 / 6.378e6, rel=0.01)


def residual(
    errors: np.ndarray, flex: np.ndarray, *, nonlinear: bool, arm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Innovation when the truth has ``flex`` and the filter's slave has ``errors``."""
    C_m = ATTITUDE
    euler = np.array([0.7, 0.1, -0.2])
    M = euler_difference_matrix(np.array(0.7), np.array(0.1))
    u = flex[:3] + flex[3:6]
    C_s = C_m @ rotation_from_vector(u)
    C = rotation_from_vector(-errors[:3]) @ C_s
    V_true = VELOCITY + C_m @ np.cross(flex[6:9], -skew_arm(arm))
    H, y = np.zeros((6, 24)), np.zeros(6)
    estimate = np.zeros(9)
    m.measurement_rows(
        C, V_true + errors[3:6], estimate, euler, C_m, VELOCITY, M, arm, nonlinear, H, y, A
    )
    return H, y


def skew_arm(arm: np.ndarray) -> np.ndarray:
    return -np.array([arm[2, 1], arm[0, 2], arm[1, 0]])


@pytest.mark.parametrize("nonlinear", [False, True])
def test_matching_rows_predict_a_small_truth(nonlinear: bool) -> None:
    rng = np.random.default_rng(2)
    arm = skew(np.array([5.0, 0.1, 0.1]))
    errors = np.concatenate([1e-5 * rng.normal(size=3), 1e-3 * rng.normal(size=3)])
    flex = np.concatenate([1e-5 * rng.normal(size=6), 1e-4 * rng.normal(size=3)])
    H, y = residual(errors, flex, nonlinear=nonlinear, arm=arm)
    x = np.concatenate([errors, np.zeros(9), flex])
    np.testing.assert_allclose(H @ x, y, atol=2e-9)
    np.testing.assert_array_equal(H[:, 6:15], 0.0)


def test_exact_rows_are_the_derivative_at_a_large_angle() -> None:
    euler = np.array([0.7, 0.1, -0.2])
    M = euler_difference_matrix(np.array(0.7), np.array(0.1))
    flex = np.array([0.01, -0.008, 0.012, 0.002, 0.015, -0.001, 0.0, 0.0, 0.0])
    C = ATTITUDE @ rotation_from_vector(flex[:3] + flex[3:6])
    arm, step_size = np.zeros((3, 3)), 1e-6

    def innovation(du: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        H, y, at = np.zeros((6, 24)), np.zeros(6), flex.copy()
        at[:3] += du
        m.measurement_rows(C, VELOCITY, at, euler, ATTITUDE, VELOCITY, M, arm, True, H, y, A)
        return H.copy(), y.copy()

    H, y = innovation(np.zeros(3))
    np.testing.assert_allclose(y, 0.0, atol=1e-14)
    for axis, e in enumerate(np.eye(3)):
        slope = (innovation(step_size * e)[1] - innovation(-step_size * e)[1]) / (2 * step_size)
        np.testing.assert_allclose(-slope[3:], H[3:, m.RHO + axis], atol=1e-8)


def test_heading_difference_is_wrapped() -> None:
    C = dcm_from_euler(np.array(-np.pi + 1e-4), np.array(0.0), np.array(0.0))
    euler = np.array([np.pi - 1e-4, 0.0, 0.0])
    M = euler_difference_matrix(np.array(np.pi), np.array(0.0))
    H, y, zero = np.zeros((6, 24)), np.zeros(6), np.zeros(3)
    m.measurement_rows(C, zero, np.zeros(9), euler, C, zero, M, np.zeros((3, 3)), False, H, y, A)
    assert y[3] == pytest.approx(2e-4, abs=1e-12)


def test_feedback_takes_the_errors_off() -> None:
    dx = np.zeros(24)
    dx[:3], dx[3:6], dx[6:9] = [1e-3, -2e-3, 1e-3], [0.1, 0.2, 0.3], [1e-6, 2e-6, 1.0]
    dx[9:15], dx[15:24] = np.arange(6) * 1e-6, np.arange(9) * 1e-4
    C = rotation_from_vector(-dx[:3]) @ ATTITUDE
    V, p, bias, flex = VELOCITY + dx[3:6], POSITION + dx[6:9], np.zeros(6), np.zeros(9)
    m.feed_back(C, V, p, bias, flex, dx, A)
    np.testing.assert_allclose(C, ATTITUDE, atol=1e-14)
    np.testing.assert_allclose(V, VELOCITY, atol=1e-13)
    np.testing.assert_allclose(p, POSITION, atol=1e-12)
    np.testing.assert_array_equal(bias, dx[9:15])
    np.testing.assert_array_equal(flex, dx[15:24])
