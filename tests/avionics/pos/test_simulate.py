"""The slave's truth against first-order formulas and against its own geometry."""

import numpy as np
import pytest

from avionics.pos import earth
from avionics.pos.attitude import rotation_from_vector
from avionics.pos.flexure import Flexure
from avionics.pos.simulate import (
    relative_acceleration,
    simulate,
    slave_truth,
)
from avionics.pos.trajectory import Trajectory
from tests.avionics.pos.conftest import DT, make_node


def smooth_flexure(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A flexure that can be differentiated: rad, rad/s."""
    amplitude, w = np.array([2e-3, 6e-3, 1e-3]), np.array([1.0, 0.7, 1.3])
    return amplitude * np.sin(w * t[:, None]), amplitude * w * np.cos(w * t[:, None])


def test_relative_acceleration_of_a_turntable() -> None:
    rate, r = np.array([0.0, 0.0, 2.0]), np.array([3.0, 0.0, 0.0])
    zero = np.zeros(3)
    np.testing.assert_allclose(relative_acceleration(rate, zero, r, zero, zero), [-12.0, 0.0, 0.0])
    spin_up = relative_acceleration(zero, np.array([0.0, 0.0, 1.0]), r, zero, zero)
    np.testing.assert_allclose(spin_up, [0.0, 3.0, 0.0])
    coriolis = relative_acceleration(rate, zero, zero, np.array([1.0, 0.0, 0.0]), zero)
    np.testing.assert_allclose(coriolis, [0.0, 4.0, 0.0])


@pytest.mark.parametrize("gyro", ["instant", "integrating"])
def test_slave_rate_to_first_order(trajectory: Trajectory, gyro: str) -> None:
    node = make_node(rho=np.full(3, 1e-4), gyro=gyro)
    theta, rate = smooth_flexure(trajectory.t)
    theta, rate = 0.01 * theta, 0.01 * rate
    truth, rate_m, _ = slave_truth(trajectory, node, theta, rate, {})
    u = node.rho + theta
    expected = rate_m + np.cross(rate_m, u) + rate
    # What is left out: u x theta_dot / 2 and u^2 w, both below 2e-8 rad/s; means lag by dt / 2.
    atol = 2e-8 if gyro == "instant" else 1.5e-6
    np.testing.assert_allclose(truth.rate[1:], expected[1:], atol=atol)


def test_integrated_gyros_reproduce_the_attitude(trajectory: Trajectory) -> None:
    node = make_node()
    theta, rate = smooth_flexure(trajectory.t)
    truth, _, _ = slave_truth(trajectory, node, theta, rate, {})
    start = earth.inertial_from_navigation(
        trajectory.latitude[:1], trajectory.longitude[:1], trajectory.t[:1]
    )
    C = (start @ truth.D_n_from_s[:1])[0]
    for k in range(1, 3000):
        C = C @ rotation_from_vector(truth.rate[k] * DT)
    end = (
        earth.inertial_from_navigation(
            trajectory.latitude[2999:3000], trajectory.longitude[2999:3000], trajectory.t[2999:3000]
        )[0]
        @ truth.D_n_from_s[2999]
    )
    np.testing.assert_allclose(C, end, atol=1e-11)


@pytest.mark.parametrize("gyro", ["instant", "integrating"])
@pytest.mark.parametrize("arm", ["rigid", "flexing"])
def test_slave_force_is_the_derivative_of_its_velocity(
    trajectory: Trajectory, gyro: str, arm: str
) -> None:
    """V_dot = C f - (2 w_ie + w_en) x V + g for the slave itself, an arm's length away."""
    node = make_node(gyro=gyro, arm=arm)
    theta, rate = smooth_flexure(trajectory.t)
    truth, _, _ = slave_truth(trajectory, node, theta, rate, {})
    V = truth.velocity
    ie = earth.earth_rate(trajectory.latitude)
    en = earth.transport_rate(trajectory.latitude, trajectory.height, V)
    g = np.zeros_like(V)
    g[:, 2] = -earth.gravity(trajectory.latitude, trajectory.height)
    model = np.einsum("kij,kj->ki", truth.D_n_from_s, truth.force) - np.cross(2 * ie + en, V) + g
    if gyro == "instant":
        numeric, model = (V[2:] - V[:-2]) / (2 * DT), model[1:-1]
    else:  # means over the step
        C = 0.5 * (truth.D_n_from_s[1:] + truth.D_n_from_s[:-1])
        rest = (g - np.cross(2 * ie + en, V))[1:]
        numeric = (V[1:] - V[:-1]) / DT
        model = np.einsum("kij,kj->ki", C, truth.force[1:]) + rest
    jumps = np.abs(np.diff(trajectory.rate_dot, axis=0)).max(axis=1) > 0.02
    near = np.convolve(jumps, np.ones(5), "same")[: len(numeric)] > 0
    error = (numeric - model)[~near]  # at a leg's edge a central difference sees half the jump
    # An arm of 5 m crosses 1e-7 rad of meridian; r_ddot lags by half a step (5 m * 0.01 rad/s^3).
    assert np.abs(error).max() < 3e-3
    assert np.abs(error.mean(axis=0)).max() < 2e-4


def test_noise_has_the_asked_sigmas_and_streams_are_independent(trajectory: Trajectory) -> None:
    node = make_node()
    truth, measured = simulate(trajectory, node, np.random.default_rng(5))
    noise = measured.rate_s - truth.rate - truth.bias["rate_s"]
    assert noise.std() == pytest.approx(node.slave.gyro_noise, rel=0.02)
    heading = measured.euler[:, 0] - trajectory.euler[:, 0]
    assert heading.std() == pytest.approx(node.reference.heading, rel=0.03)
    rigid, _ = simulate(trajectory, make_node(arm="rigid"), np.random.default_rng(5))
    np.testing.assert_array_equal(rigid.theta, truth.theta)
    again, _ = simulate(trajectory, node, np.random.default_rng(5))
    np.testing.assert_array_equal(again.force, truth.force)


def test_stiff_node_without_arm_reads_what_the_master_reads(trajectory: Trajectory) -> None:
    stiff = Flexure(np.ones(3), np.ones(3), np.zeros(3))
    node = make_node(rho=np.zeros(3), r0=np.zeros(3), flexure=stiff)
    zero = np.zeros((len(trajectory.t), 3))
    truth, rate_m, force_m = slave_truth(trajectory, node, zero, zero, {})
    np.testing.assert_allclose(truth.rate, rate_m, atol=1e-15)
    np.testing.assert_allclose(truth.force, force_m, atol=1e-12)
