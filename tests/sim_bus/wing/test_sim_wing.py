"""The wing's truth: consistent with itself, and with the estimator's geometry where it must be."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from avionics.config import Config, Marker
from avionics.config.load import parse_config
from avionics.flight.filter_setup import pinhole_from_config
from avionics.wse.attitude import station_attitude
from sim_bus.camera.lens import project, undistorted_grid
from sim_bus.wing.build import make_wing
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.root_motion import RootMotion, Swing
from sim_bus.wing.scenario import Scenario, load_scenario, packaged_scenarios, parse_scenario
from sim_bus.wing.sim_wing import SimWing

pytestmark = pytest.mark.slow


def flying(config: Config, scenario: Scenario | str, **options) -> SimWing:
    if isinstance(scenario, str):
        scenario = load_scenario(scenario)
    return make_wing(config, scenario, rng=np.random.default_rng(0), **options)


def at(*seconds: float) -> np.ndarray:
    return np.array([round(s * 1e9) for s in seconds], dtype=np.int64)


@pytest.fixture(scope="module")
def bent(config: Config) -> SimWing:
    """A wing that 45 s of the oblique flight have bent, twisted and pulled in its plane."""
    return flying(config, "oblique", keep_s=60.0)


@pytest.fixture(scope="module")
def swept() -> Config:
    return parse_config({"wing": {"span_m": 1.5, "psi0_deg": 25.0}}, origin="test")


def test_rests_sagging_then_moves(config: Config) -> None:
    wing = flying(config, "default")
    before, start, later = (wing.truth(int(t)) for t in at(-3.0, 0.0, 9.0))
    assert start.line_in_body_m[-1] == pytest.approx(before.line_in_body_m[-1])
    # About six degrees at rest, tip down.
    assert np.degrees(start.phi_rad[-1]) == pytest.approx(7, abs=2)
    assert start.line_in_body_m[-1, 2] > 0.08
    assert np.abs(later.line_in_body_m[-1] - start.line_in_body_m[-1]).max() > 0.05


def test_line_is_the_integral_of_its_tangent_by_the_papers_angles(
    config: Config, bent: SimWing
) -> None:
    """crg-wse.md, section 1: t = D^T e_y from (phi, theta, psi) must rebuild the line."""
    truth = bent.truth(int(at(44.9)[0]))
    tangents = np.array(
        [
            station_attitude(*angles).T @ np.array([0.0, 1.0, 0.0])
            for angles in zip(truth.phi_rad, truth.theta_rad, truth.psi_rad, strict=True)
        ]
    )
    step = config.wing.span_m / (len(tangents) - 1)
    rebuilt = np.cumsum(0.5 * (tangents[1:] + tangents[:-1]) * step, axis=0)
    assert np.abs(truth.theta_rad).max() > 0.02
    assert np.abs(truth.psi_rad).max() > 0.02
    # Trapezoid over 30 intervals of a wing bent by half a radian; stretch is below 1e-4.
    assert rebuilt == pytest.approx(truth.line_in_body_m[1:], abs=4e-4)


def test_sections_stand_as_the_papers_attitude_says(bent: SimWing) -> None:
    s_m = np.linspace(0, 1.5, 31)
    t_ns = at(44.9)
    truth = bent.truth(int(t_ns[0]))
    frames = bent.stations(t_ns, s_m).D_body_from_local[0]
    for k in (5, 18, 30):
        attitude = station_attitude(truth.phi_rad[k], truth.theta_rad[k], truth.psi_rad[k])
        assert pytest.approx(attitude, abs=1e-12) == frames[k].T


def test_sweep_turns_the_root_aft(swept: Config) -> None:
    wing = flying(swept, parse_scenario({"name": "rest"}, origin="test"))
    truth = wing.truth(0)
    assert np.degrees(truth.psi_rad[0]) == pytest.approx(25.0)
    assert truth.line_in_body_m[-1, 0] < -0.5
    first = truth.line_in_body_m[1] / np.linalg.norm(truth.line_in_body_m[1])
    wanted = [-np.sin(np.radians(25)), np.cos(np.radians(25)), 0]
    assert first == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize("name", ["default", "oblique", "moving_root"])
def test_rates_are_the_derivative_of_attitude(config: Config, name: str) -> None:
    wing = flying(config, name)
    h_s, t_s = 1e-5, 13.3337
    s_m = np.array([0.2, 0.9, 1.5])
    times = at(t_s - h_s, t_s, t_s + h_s)
    found = wing.stations(times, s_m)
    to_earth = wing.body_from_earth(times).transpose(0, 2, 1)
    frames = np.einsum("nij,nsjk->nsik", to_earth, found.D_body_from_local)
    turned = np.einsum("sji,sjk->sik", frames[1], frames[2] - frames[0]) / (2 * h_s)
    rate = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=1)
    assert np.abs(rate).max() > 0.1
    assert found.rate_rad_s[1] == pytest.approx(rate, abs=2e-5)


@pytest.mark.parametrize("name", ["default", "moving_root"])
def test_specific_force_is_acceleration_less_gravity(config: Config, name: str) -> None:
    """Against the second difference of the position over 8 ms, in earth axes."""
    wing = flying(config, name)
    s_m, h_s, t_s = np.array([0.6, 1.2]), 4e-3, 13.302
    times = at(t_s - h_s, t_s, t_s + h_s)
    found = wing.stations(times, s_m)
    to_earth = wing.body_from_earth(times).transpose(0, 2, 1)
    place = np.einsum("nij,nsj->nsi", to_earth, found.r_in_body_m)
    place += wing._root._coordinates(times * 1e-9)[0, 3:].T[:, None]
    accel = (place[2] - 2 * place[1] + place[0]) / h_s**2
    force = np.einsum(
        "sji,jk,sk->si", found.D_body_from_local[1], wing.body_from_earth(times)[1],
        accel - np.array([0.0, 0.0, 9.80665]),
    )  # fmt: skip
    assert found.specific_force_m_s2[1] == pytest.approx(force, abs=0.12)


def test_at_rest_the_chip_feels_gravity_alone(config: Config) -> None:
    wing = flying(config, "default")
    rate, force, flux = PodMotion(wing, config.pods[1]).sense(at(1.0))
    assert rate == pytest.approx(np.zeros((1, 3)), abs=1e-9)
    assert np.linalg.norm(force) == pytest.approx(9.80665, abs=1e-6)
    assert force[0, 2] < -9.5
    assert np.linalg.norm(flux) == pytest.approx(np.hypot(2.0e-5, 4.5e-5), rel=1e-2)


def test_turned_sensor_sees_turned_axes(config: Config) -> None:
    turned = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    pod = config.pods[0].model_copy(update={"R_sensor_from_local": turned})
    wing = flying(config, "default")
    plain, other = (PodMotion(wing, p).sense(at(6.1))[0][0] for p in (config.pods[0], pod))
    assert other == pytest.approx([plain[1], -plain[0], plain[2]])


def test_projection_is_the_estimators(config: Config) -> None:
    """Two codes, one convention: all angles and all lens terms on."""
    camera = config.camera.model_copy(
        update={
            "pan_deg": 7.0, "roll_deg": -4.0, "tilt_deg": -17.0, "p1": 1e-3, "p2": -2e-3,
            "k3": 0.02, "f_y_px": 600.0,
        }
    )  # fmt: skip
    wing = flying(config, "default")
    points = wing.points(at(0.0, 7.0), config.markers)
    mine, depth = project(camera, points)
    assert (depth > 0.3).all()
    assert mine == pytest.approx(pinhole_from_config(camera).project(points), abs=1e-9)


def test_rays_are_the_inverse_of_the_lens(config: Config) -> None:
    camera = config.camera.model_copy(update={"p1": 1e-3, "width_px": 64, "height_px": 48})
    x, y = undistorted_grid(camera)
    axis, right, down = np.eye(3)[1], -np.eye(3)[0], np.eye(3)[2]
    flat = camera.model_copy(update={"tilt_deg": 0.0, "r_in_body_m": (0.0, 0.0, 0.0)})
    points = axis + x[..., None] * right + y[..., None] * down
    pixel, _ = project(flat, points)
    v, u = np.mgrid[0:48, 0:64]
    assert pixel == pytest.approx(np.stack([u, v], -1).astype(float), abs=1e-6)


def test_behind_the_camera_is_nowhere(config: Config) -> None:
    pixel, depth = project(config.camera, np.array([0.0, -1.0, 0.0]))
    assert np.isnan(pixel).all()
    assert depth < 0


def test_left_out_times_do_not_change_the_flight(config: Config) -> None:
    asked_often, asked_once = flying(config, "gust"), flying(config, "gust")
    for k in range(60):
        asked_often.truth(k * 100_000_000)
    a, b = (w.truth(5_950_000_000) for w in (asked_often, asked_once))
    assert a.line_in_body_m.tobytes() == b.line_in_body_m.tobytes()


def test_long_past_is_refused_not_invented(config: Config) -> None:
    wing = flying(config, "default", keep_s=2.0)
    wing.truth(int(5e9))
    with pytest.raises(ValueError, match="forgotten"):
        wing.truth(int(1e9))


def test_known_times_are_answered_while_another_thread_integrates(config, monkeypatch) -> None:
    wing = flying(config, "default")
    known = wing.truth(int(1e9))
    marching, may_end = threading.Event(), threading.Event()

    def integrate() -> None:
        marching.set()
        assert may_end.wait(10.0)
        real_integrate()

    real_integrate = wing._integrate
    monkeypatch.setattr(wing, "_integrate", integrate)
    with ThreadPoolExecutor(2) as threads:
        ahead = threads.submit(wing.truth, int(2e9))
        assert marching.wait(10.0)
        try:
            again = threads.submit(wing.truth, int(1e9)).result(timeout=5.0)
        finally:
            may_end.set()
        assert again.line_in_body_m.tobytes() == known.line_in_body_m.tobytes()
        assert ahead.result(timeout=10.0).t_ns == int(2e9)


def test_marker_sits_in_its_section(bent: SimWing) -> None:
    t_ns = at(45.0)
    on_line, off = (
        bent.points(t_ns, (Marker(id=0, s_m=1.2, x_m=x, z_m=z),))[0, 0]
        for x, z in ((0.0, 0.0), (0.07, -0.012))
    )
    frame = bent.stations(t_ns, np.array([1.2])).D_body_from_local[0, 0]
    assert frame.T @ (off - on_line) == pytest.approx([0.07, 0.0, -0.012], abs=1e-12)


@pytest.mark.parametrize("name", packaged_scenarios())
def test_packaged_flights_bend_far_and_stay_sound(config: Config, name: str) -> None:
    scenario = load_scenario(name)
    wing = flying(config, scenario)
    truths = [wing.truth(round(t * 1e9)) for t in np.arange(0, 20, 0.1)]
    slopes = np.degrees([t.phi_rad[-1] for t in truths])
    assert np.isfinite(slopes).all()
    assert 15 < np.ptp(slopes) < 110


def test_root_rates_are_the_derivative_of_its_attitude() -> None:
    swings = tuple(
        Swing(axis, amplitude, hz, 0.3 * axis, 0.5, 30.0, 1.0)
        for axis, amplitude, hz in ((0, 0.5, 0.7), (1, 0.3, 1.1), (2, 0.6, 0.5), (4, 0.2, 1.3))
    )
    root = RootMotion(swings)
    h, t = 1e-5, 3.3
    times = np.array([t - h, t, t + h])
    drive, body_from_earth = root.drive(times), root.attitude(times)
    turned = (body_from_earth[2] - body_from_earth[0]) @ body_from_earth[1].T / (2 * h)
    rate = -np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
    assert drive[1, :3] == pytest.approx(rate, abs=1e-7)
    assert drive[1, 3:6] == pytest.approx((drive[2, :3] - drive[0, :3]) / (2 * h), abs=1e-7)
    velocity = np.einsum("nji,nj->ni", body_from_earth, drive[:, 9:12])
    accel = (velocity[2] - velocity[0]) / (2 * h)
    felt = body_from_earth[1] @ (accel - np.array([0.0, 0.0, 9.80665]))
    assert drive[1, 6:9] == pytest.approx(felt, abs=1e-6)


def test_left_wing_is_the_right_one_in_the_mirror(config: Config) -> None:
    """GIVEN the same loads THEN positions mirror in y, rates turn their x and z around, and all
    of it is still one rigid motion of right-handed axes."""
    other = config.model_copy(update={"wing": config.wing.model_copy(update={"side": "left"})})
    right, left = flying(config, "oblique"), flying(other, "oblique")
    t_s, h_s = 9.2, 1e-5
    times, s_m = at(t_s - h_s, t_s, t_s + h_s), np.array([0.6, 1.5])
    a, b = right.stations(times, s_m), left.stations(times, s_m)
    assert b.r_in_body_m == pytest.approx(a.r_in_body_m * [1, -1, 1])
    assert b.rate_rad_s == pytest.approx(a.rate_rad_s * [-1, 1, -1])
    frames = b.D_body_from_local
    assert np.linalg.det(frames[1]) == pytest.approx([1.0, 1.0])
    turned = np.einsum("sji,sjk->sik", frames[1], frames[2] - frames[0]) / (2 * h_s)
    rate = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=1)
    assert b.rate_rad_s[1] == pytest.approx(rate, abs=2e-5)
    assert left.truth(int(9e9)).phi_rad == pytest.approx(right.truth(int(9e9)).phi_rad)
