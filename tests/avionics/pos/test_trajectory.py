"""Earth and trajectories against independent geometry and finite differences."""

import numpy as np
import pytest

from avionics.pos import earth
from avionics.pos.attitude import vector_from_rotation
from avionics.pos.motion import Leg, Start, half_step_times, motion_along_legs, ramped_profile
from avionics.pos.recorded import motion_from_samples
from avionics.pos.trajectory import Trajectory, trajectory_from_motion
from avionics.pos.wobble import Wobble, add_wobble
from tests.avionics.pos.conftest import DEG, DT, LEGS, START, fly


def ecef(latitude: np.ndarray, longitude: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Cartesian position, by the ellipsoid's axes and not by the module's radii."""
    a, b = 6378137.0, 6356752.314245179
    n = a**2 / np.sqrt((a * np.cos(latitude)) ** 2 + (b * np.sin(latitude)) ** 2)
    return np.stack(
        [
            (n + height) * np.cos(latitude) * np.cos(longitude),
            (n + height) * np.cos(latitude) * np.sin(longitude),
            (n * (b / a) ** 2 + height) * np.sin(latitude),
        ],
        axis=-1,
    )


def test_radii_and_gravity_at_known_places() -> None:
    a, b = 6378137.0, 6356752.314245179
    assert earth.meridian_radius(0.0) == pytest.approx(b**2 / a, rel=1e-12)
    assert earth.normal_radius(np.pi / 2) == pytest.approx(a**2 / b, rel=1e-12)
    assert earth.meridian_radius(np.pi / 2) == pytest.approx(a**2 / b, rel=1e-12)
    # WGS-84 normal gravity (NIMA TR8350.2): equator, pole, and 45 deg from the formula's table.
    assert earth.gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=1e-9)
    assert earth.gravity(np.pi / 2, 0.0) == pytest.approx(9.8321849378, abs=1e-8)
    assert earth.gravity(np.pi / 4, 0.0) == pytest.approx(9.8061977, abs=1e-7)
    assert earth.gravity(0.0, 1000.0) == pytest.approx(9.7803253359 * (1 - 2e3 / a), rel=1e-12)


def test_profile_has_unit_integral_and_its_derivatives() -> None:
    x = np.linspace(0.0, 30.0, 30001)
    integral, value, slope, bend = ramped_profile(x, 30.0, 5.0)
    assert integral[0] == 0.0
    assert integral[-1] == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(np.gradient(integral, x)[1:-1], value[1:-1], atol=1e-7)
    np.testing.assert_allclose(np.gradient(value, x)[1:-1], slope[1:-1], atol=1e-5)
    inside = np.abs(x - 2.5) < 2.4
    np.testing.assert_allclose(np.gradient(slope, x)[inside], bend[inside], atol=1e-6)


def test_legs_end_exactly_where_the_table_says(trajectory: Trajectory) -> None:
    assert trajectory.euler[-1, 0] == pytest.approx(START.heading + 20.0 * DEG, abs=1e-12)
    assert np.linalg.norm(trajectory.velocity[-1]) == pytest.approx(130.0, abs=1e-9)
    assert trajectory.height[-1] - trajectory.height[0] == pytest.approx(80.0, abs=1e-6)


def test_rate_is_that_of_the_inertial_attitude(trajectory: Trajectory) -> None:
    C = (
        earth.inertial_from_navigation(trajectory.latitude, trajectory.longitude, trajectory.t)
        @ trajectory.D_n_from_m
    )
    mean = vector_from_rotation(np.swapaxes(C[:-1], 1, 2) @ C[1:]) / DT
    expected = 0.5 * (trajectory.rate[1:] + trajectory.rate[:-1])
    # Trapezoid: dt^2 / 12 times the rate's second derivative, below 0.06 rad/s^3 here.
    np.testing.assert_allclose(mean, expected, atol=1e-6)


def test_rate_dot_is_the_derivative_of_the_rate(trajectory: Trajectory) -> None:
    numeric = (trajectory.rate[2:] - trajectory.rate[:-2]) / (2 * DT)
    edges = np.cumsum([leg.duration for leg in LEGS])
    kinks = np.concatenate([edges, edges - 5.0, [0.0, 5.0], edges + 5.0])
    smooth = np.min(np.abs(trajectory.t[1:-1, None] - kinks), axis=1) > 0.05
    np.testing.assert_allclose(numeric[smooth], trajectory.rate_dot[1:-1][smooth], atol=2e-5)


def test_velocity_is_that_of_the_position(trajectory: Trajectory) -> None:
    r = ecef(trajectory.latitude, trajectory.longitude, trajectory.height)
    numeric = (r[2:] - r[:-2]) / (2 * DT)
    C_e = earth.inertial_from_navigation(
        trajectory.latitude, trajectory.longitude, np.zeros_like(trajectory.t)
    )
    expected = np.einsum("kij,kj->ki", C_e, trajectory.velocity)[1:-1]
    np.testing.assert_allclose(numeric, expected, atol=1e-4)


def test_specific_force_is_inertial_acceleration_less_gravitation(trajectory: Trajectory) -> None:
    """Second differences of the inertial position; gravitation = gravity + centripetal term."""
    t = trajectory.t
    r_e = ecef(trajectory.latitude, trajectory.longitude, trajectory.height)
    spin = earth.EARTH_RATE * t
    x = np.cos(spin) * r_e[:, 0] - np.sin(spin) * r_e[:, 1]
    y = np.sin(spin) * r_e[:, 0] + np.cos(spin) * r_e[:, 1]
    r_i = np.stack([x, y, r_e[:, 2]], axis=-1)
    wide = 3
    h = wide * DT
    acceleration = (r_i[2 * wide :] - 2 * r_i[wide:-wide] + r_i[: -2 * wide]) / h**2
    C = earth.inertial_from_navigation(trajectory.latitude, trajectory.longitude, t)
    up = C[:, :, 2]
    axis = np.array([0.0, 0.0, earth.EARTH_RATE])
    gravitation = -earth.gravity(trajectory.latitude, trajectory.height)[:, None] * up
    gravitation += np.cross(axis, np.cross(axis, r_i))
    force_i = np.einsum("kij,kjl,kl->ki", C, trajectory.D_n_from_m, trajectory.force)
    found = acceleration - gravitation[wide:-wide]
    # 1e-9 m of rounding in the position over h^2; at the legs' edges the jerk jumps.
    np.testing.assert_allclose(found, force_i[wide:-wide], atol=6e-3)
    assert np.abs((found - force_i[wide:-wide]).mean(axis=0)).max() < 1e-4


def test_coordinated_turn_has_no_side_force_and_a_flat_one_has() -> None:
    legs = (Leg(30.0, turn=60.0 * DEG),)
    banked, flat = fly(legs), fly(legs, banked=False)
    middle = 1500
    assert abs(banked.force[middle, 0]) < 0.03  # Coriolis and gravity's departure from 9.80665
    rate = 60.0 * DEG / 25.0
    assert flat.force[middle, 0] == pytest.approx(100.0 * rate, rel=0.01)


def test_bad_legs_are_refused() -> None:
    with pytest.raises(ValueError, match="leg 1: lasts 8"):
        fly((Leg(8.0, turn=1.0),))
    with pytest.raises(ValueError, match="climb"):
        fly((Leg(20.0, climb=5000.0),))


def test_wobble_has_its_rms_consistent_derivatives_and_none_at_standstill() -> None:
    legs = (Leg(20.0), Leg(30.0, speed_change=15.0), Leg(150.0))
    start = Start(0.7, 2.0, 50.0, 0.0, 0.0)
    t = half_step_times(200.0, DT)
    plain = motion_along_legs(t, legs, start, banked=False)
    shaken = add_wobble(plain, legs, Wobble(0.6 * DEG, 0.8 * DEG, 1.0 * DEG), 0.0)
    np.testing.assert_array_equal(shaken.euler[t < 20.0], plain.euler[t < 20.0])
    rms = (shaken.euler - plain.euler)[t > 60.0].std(axis=0) / DEG
    np.testing.assert_allclose(rms, [0.6, 0.8, 1.0], rtol=0.15)  # the slowest line: 7 periods
    numeric = np.gradient(shaken.euler, t, axis=0)[1:-1]
    np.testing.assert_allclose(numeric, shaken.euler_d1[1:-1], atol=1e-4)
    numeric = np.gradient(shaken.euler_d1, t, axis=0)[1:-1]
    np.testing.assert_allclose(numeric, shaken.euler_d2[1:-1], atol=2e-3)


def test_recorded_samples_come_back_as_the_motion_they_were() -> None:
    t = np.arange(0.0, 20.0, 0.02)
    euler = np.stack([0.3 * t, 0.02 * np.sin(t), 0.03 * np.cos(2 * t)], axis=-1)
    velocity = np.stack([10 * np.sin(0.3 * t), 10 * np.cos(0.3 * t), 0 * t], axis=-1)
    motion = motion_from_samples(t, euler, velocity, DT)
    expected = -0.12 * np.cos(2 * motion.t)
    np.testing.assert_allclose(motion.euler_d2[50:-50, 2], expected[50:-50], atol=1e-5)
    trajectory = trajectory_from_motion(motion, Start(0.7, 0.1, 0.0, 0.0, 10.0))
    assert np.isfinite(trajectory.force).all()
    with pytest.raises(ValueError, match="increase"):
        motion_from_samples(t[::-1], euler, velocity, DT)
