"""Gyro and accelerometer rows: closed forms, numerical derivatives, noise-free truth."""

import numpy as np
import pytest

from avionics.pos.attitude import right_jacobian, rotation_from_vector, skew
from avionics.pos.difference_filter import rate_derivative
from avionics.pos.difference_model import Layout, Switches, layout, pattern_of, transition
from avionics.pos.flexure import discretise
from avionics.pos.force_rows import force_rows
from avionics.pos.gyro_rows import gyro_rows
from avionics.pos.second_order import second_order_variance
from avionics.pos.simulate import slave_truth
from avionics.pos.trajectory import Trajectory
from tests.avionics.pos.conftest import DT, make_node

W = np.array([0.01, -0.02, 0.015])
W_DOT = np.array([0.002, 0.001, -0.003])
F = np.array([0.3, 0.5, 9.9])
R0 = np.array([5.0, 0.1, 0.1])
A = np.empty((10, 3, 3))


def gyro(
    x: np.ndarray, rate_s: np.ndarray, at: Layout, size: int, how: Switches
) -> tuple[np.ndarray, np.ndarray]:
    H, y = np.zeros((3, size)), np.zeros(3)
    gyro_rows(x, W, rate_s, DT, at, how, H, y, A)
    return H, y


def force(
    x: np.ndarray, force_s: np.ndarray, at: Layout, size: int, how: Switches
) -> tuple[np.ndarray, np.ndarray]:
    H, y = np.zeros((3, size)), np.zeros(3)
    arm = np.cross(W, np.cross(W, R0)) + np.cross(W_DOT, R0)
    force_rows(x, F, arm, force_s, W, W_DOT, R0, DT, at, how, H, y, A)
    return H, y


def numeric(function: object, x: np.ndarray, steps: np.ndarray) -> np.ndarray:
    columns = []
    for i, step in enumerate(steps):
        d = np.zeros_like(x)
        d[i] = step
        columns.append((function(x + d) - function(x - d)) / (2 * step))  # type: ignore[operator]
    return -np.stack(columns, axis=-1)


def some_state(size: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    x = np.zeros(size)
    x[:6] = 0.01 * rng.normal(size=6)
    x[6:9] = 3e-3 * rng.normal(size=3)
    x[9:] = 1e-5 * rng.normal(size=size - 9)
    return x


def test_linear_gyro_rows_are_gongs() -> None:
    """Eq. 18 with true rate = output - error: [w x, w x, I, -I, I]."""
    at, size = layout(gyros=True, forces=False, d_theta=False, d_rate=False)
    H, y = gyro(np.zeros(size), W + 0.1, at, size, Switches(False, False, True, False))
    I3 = np.eye(3)
    np.testing.assert_allclose(H, np.hstack([skew(W), skew(W), I3, -I3, I3]))
    np.testing.assert_allclose(y, 0.1)


def test_linear_force_rows_are_gongs_and_the_option_puts_the_arm_in() -> None:
    at, size = layout(gyros=False, forces=True, d_theta=False, d_rate=False)
    arm = np.cross(W, np.cross(W, R0)) + np.cross(W_DOT, R0)
    I3, zero = np.eye(3), np.zeros((3, 3))
    for in_H, lever in ((False, F), (True, F + arm)):
        H, y = force(np.zeros(size), F + arm + 0.2, at, size, Switches(False, False, in_H, False))
        np.testing.assert_allclose(H, np.hstack([skew(lever), skew(lever), zero, -I3, I3]))
        np.testing.assert_allclose(y, 0.2)


@pytest.mark.parametrize("integrating", [False, True])
@pytest.mark.parametrize("forces", [False, True])
def test_exact_gyro_rows_are_the_derivative(integrating: bool, forces: bool) -> None:
    """All columns; for u up to the term that is left out on purpose with gyros alone."""
    at, size = layout(gyros=True, forces=forces, d_theta=integrating, d_rate=False)
    how, x = Switches(True, integrating, True, False), some_state(size)
    H, _ = gyro(x, W, at, size, how)
    steps = np.full(size, 1e-7)
    found = numeric(lambda s: gyro(s, W, at, size, how)[1], x, steps)
    flexing = x[at.d_theta : at.d_theta + 3] / DT if integrating else x[6:9]
    left_out = 0.5 * skew(flexing)
    if forces and integrating:
        left_out = 0.0 * left_out
    expected = H.copy()
    expected[:, :3] += left_out
    expected[:, 3:6] += left_out
    # Second order of what is left out or put back: u^2 theta_dot / 6, and the same by dt.
    atol = 2e-5 if not integrating else 2e-4
    np.testing.assert_allclose(found[:, :6], expected[:, :6], atol=5e-5)
    np.testing.assert_allclose(found[:, 9:15], expected[:, 9:15], atol=1e-5)
    if integrating:
        columns = slice(at.d_theta, at.d_theta + 3)
        np.testing.assert_allclose(found[:, columns], expected[:, columns], atol=20 * atol)
    else:
        np.testing.assert_allclose(found[:, 6:9], expected[:, 6:9], atol=1e-6)


def test_exact_force_rows_are_the_derivative_without_the_arms_acceleration() -> None:
    at, size = layout(gyros=True, forces=True, d_theta=True, d_rate=True)
    how, x = Switches(True, True, True, True), some_state(size)
    x[at.d_rate : at.d_rate + 3] = 0.0
    H, _ = force(x, F, at, size, how)
    found = numeric(lambda s: force(s, F, at, size, how)[1], x, np.full(size, 1e-6))
    np.testing.assert_allclose(found[:, 9:15], 0.0, atol=1e-12)
    np.testing.assert_allclose(found[:, 15:21], H[:, 15:21], atol=1e-6)
    # The bias of the master is turned with f; all else to the arm's Coriolis term, 4e-4 m/s^2.
    np.testing.assert_allclose(found[:, :6], H[:, :6], atol=2e-3)
    np.testing.assert_allclose(found[:, 6:9], H[:, 6:9], atol=1e-6)
    np.testing.assert_allclose(found[:, 21:], H[:, 21:], atol=2e-3)


def test_angle_derivative_ignores_an_estimated_arm_acceleration() -> None:
    at, size = layout(gyros=True, forces=True, d_theta=True, d_rate=True)
    how, x = Switches(True, True, True, True), some_state(size)
    quiet, _ = force(x, F, at, size, how)
    x[at.d_rate : at.d_rate + 3] = 5e-3
    shaken, _ = force(x, F, at, size, how)
    np.testing.assert_array_equal(quiet[:, :6], shaken[:, :6])


@pytest.mark.parametrize("gyro_kind", ["instant", "integrating"])
def test_innovations_vanish_on_a_noise_free_truth(trajectory: Trajectory, gyro_kind: str) -> None:
    """The measurement models of GA, evaluated at the true state, give what the sensors say."""
    integrating = gyro_kind == "integrating"
    node = make_node(gyro=gyro_kind)
    amplitude, w = np.array([2e-3, 6e-3, 1e-3]), np.array([1.0, 0.7, 1.3])
    theta = amplitude * np.sin(w * trajectory.t[:, None])
    rate = amplitude * w * np.cos(w * trajectory.t[:, None])
    truth, rate_m, force_m = slave_truth(trajectory, node, theta, rate, {})
    at, size = layout(gyros=True, forces=True, d_theta=integrating, d_rate=True)
    how = Switches(True, integrating, True, True)
    rate_dot = rate_derivative(rate_m, DT)
    arm = np.cross(rate_m, np.cross(rate_m, node.r0)) + np.cross(rate_dot, node.r0)
    H, y = np.zeros((3, size)), np.zeros(3)
    worst = np.zeros((2, 3))
    jumps = np.abs(np.diff(trajectory.rate_dot, axis=0)).max(axis=1) > 0.01
    for k in range(10, 7000, 61):
        if jumps[k - 5 : k + 5].any():
            continue  # central differences blur the edge of a leg over a few samples
        x = np.zeros(size)
        x[:3], x[3:6], x[6:9] = node.rho, theta[k], rate[k]
        if integrating:
            x[at.d_theta : at.d_theta + 3] = theta[k] - theta[k - 1]
        x[at.d_rate : at.d_rate + 3] = rate[k] - rate[k - 1]
        gyro_rows(x, rate_m[k], truth.rate[k], DT, at, how, H, y, A)
        worst[0] = np.maximum(worst[0], np.abs(y))
        force_rows(
            x, force_m[k], arm[k], truth.force[k], rate_m[k], rate_dot[k], node.r0, DT, at, how,
            H, y, A,
        )  # fmt: skip
        worst[1] = np.maximum(worst[1], np.abs(y))
    assert worst[0].max() < 1e-11  # a fifty-thousandth of the gyro noise
    assert worst[1].max() < 2e-4  # half a sample's accelerometer noise


def test_second_order_variance_is_that_of_the_cross_product() -> None:
    at, size = layout(gyros=True, forces=True, d_theta=True, d_rate=True)
    rng = np.random.default_rng(8)
    spread = np.zeros((size, size))
    spread[:3, :3] = 1e-3 * rng.normal(size=(3, 3))
    for place, scale in ((at.d_theta, 2e-6), (at.d_rate, 3e-4)):
        spread[place : place + 3, place : place + 3] = scale * rng.normal(size=(3, 3))
    draws = rng.standard_normal((200_000, size)) @ spread.T
    gyros = 0.5 * np.cross(draws[:, :3], draws[:, at.d_theta : at.d_theta + 3]) / DT
    r_ddot = np.cross(draws[:, at.d_rate : at.d_rate + 3], R0) / DT
    forces = np.cross(draws[:, :3], r_ddot)
    expected = np.concatenate([gyros.var(axis=0), forces.var(axis=0)])
    out = np.empty(6)
    how = Switches(True, True, True, True)
    second_order_variance(np.zeros(size), spread @ spread.T, R0, DT, at, how, out)
    np.testing.assert_allclose(out, expected, rtol=0.03)


def test_transition_keeps_the_increments_of_the_last_step() -> None:
    node = make_node()
    at, size = layout(gyros=True, forces=True, d_theta=True, d_rate=True)
    assert size == 27
    Phi, Q_flex = discretise(node.flexure, DT)
    D, Q = transition(Phi, Q_flex, at, size)
    x = some_state(size)
    after = x + D @ x
    np.testing.assert_allclose(after[at.d_theta :][:3], after[3:6] - x[3:6], atol=1e-17)
    np.testing.assert_allclose(after[at.d_rate :][:3], after[6:9] - x[6:9], atol=1e-17)
    np.testing.assert_allclose(after[[3, 6]], Phi[0] @ x[[3, 6]], atol=1e-17)
    np.testing.assert_array_equal(Q[at.d_theta, [3, 6]], Q_flex[0][0])
    np.testing.assert_array_equal(Q, Q.T)
    assert len(pattern_of(D)) == np.count_nonzero(D)


def test_first_order_of_the_exact_models_is_the_linear_one() -> None:
    u, w, rate = 1e-6 * np.ones(3), W, 1e-3 * np.array([1.0, -2.0, 0.5])
    exact = rotation_from_vector(u).T @ w + right_jacobian(u) @ rate
    np.testing.assert_allclose(exact, w + np.cross(w, u) + rate, atol=2e-9)
