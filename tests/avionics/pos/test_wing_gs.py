"""Gs on the wing: angles of the stations, a turning root, and its rows among the pipeline's."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from avionics.config import Config
from avionics.config.load import default_config_text, parse_config_text
from avionics.flight.filter_setup import settings_from_config, wing_gs
from avionics.flight.pipelines import Pipelines
from avionics.pos.attitude import rotation_from_vector
from avionics.pos.wing_gs import station_angles
from avionics.records import Event, WingShapeEstimate
from avionics.topics import Record, topic_of
from drivers.samples import ImuSample

pytestmark = pytest.mark.slow

PERIOD_NS = 10_000_000
BOTH = 'estimators=["crg","gs"]'


class ListSink:
    def __init__(self) -> None:
        self.records: list[tuple[str, Record, int]] = []

    def write(self, record: Record, arrival_ns: int) -> None:
        self.records.append((topic_of(record), record, arrival_ns))


@pytest.fixture
def config() -> Config:
    text = default_config_text()
    return parse_config_text(text, (BOTH, "estimator.gyro_lag_s=0.0"), origin="default")


def station(phi: float, theta: float, psi: float) -> np.ndarray:
    """D of the specification, body to station, written out."""
    c, s = math.cos, math.sin
    R1 = np.array([[1, 0, 0], [0, c(phi), s(phi)], [0, -s(phi), c(phi)]])
    R2 = np.array([[c(theta), 0, -s(theta)], [0, 1, 0], [s(theta), 0, c(theta)]])
    R3 = np.array([[c(psi), s(psi), 0], [-s(psi), c(psi), 0], [0, 0, 1]])
    return R1 @ R2 @ R3


def test_station_angles_invert_the_station_matrix_and_know_their_slopes() -> None:
    u = np.array([[0.3, -0.1, 0.05], [-0.2, 0.25, -0.1], [0.0, 0.0, 0.0]])
    angles, slopes = station_angles(u)
    for vector, (phi, theta, psi) in zip(u, angles, strict=True):
        np.testing.assert_allclose(
            station(phi, theta, psi), rotation_from_vector(vector).T, atol=1e-14
        )
    for axis in range(3):
        d = 1e-6 * np.eye(3)[axis]
        slope = (station_angles(u + d)[0] - station_angles(u - d)[0]) / 2e-6
        np.testing.assert_allclose(slopes[:, :, axis], slope, atol=1e-8)


def wing_rates(t: float, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitude, root rate and pod rates of a bending wing on a rolling, pitching root."""
    q = 0.1 + 0.08 * math.sin(4.0 * t)
    q_dot = 0.32 * math.cos(4.0 * t)
    root = np.array([0.5 * math.sin(0.9 * t), 0.3 * math.cos(0.7 * t), 0.4 * math.sin(0.5 * t)])
    pods = []
    for shape in shapes:
        pods.append(station(shape * q, 0.0, 0.0) @ root + np.array([shape * q_dot, 0.0, 0.0]))
    return np.array([q]), root, np.array(pods)


def mean_rates(k: int, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return wing_rates(k * 0.01, shapes)[1:]


def test_a_turning_root_tells_the_static_bend(config: Config) -> None:
    """GIVEN a root IMU that rolls and pitches, WHEN 60 s pass, THEN bending is known in full.

    The wing hangs 0.1 rad, which no integration of the pods' own rates could ever tell.
    """
    settings = settings_from_config(config)
    gs = wing_gs(config, settings)
    shapes = settings.basis.shape(settings.pods_s, 1)[:, 0]
    errors, sigmas = [], []
    for k in range(6000):
        root, pods = mean_rates(k, shapes)
        t_ns = k * PERIOD_NS
        gs.inputs.add_root(t_ns, root)
        for pod, rate in enumerate(pods):
            gs.inputs.add(pod, t_ns, rate)
        gs.advance(t_ns)
        if k > 4000 and k % 50 == 0:
            row = gs.estimate_at(t_ns)
            assert row is not None
            at_pods = settings.basis.shape(settings.pods_s, settings.basis.bending)
            found = at_pods @ row.x[settings.basis.phi]
            errors.append(found - shapes * wing_rates(k * 0.01, shapes)[0])
            P = row.P[settings.basis.phi, settings.basis.phi]
            sigmas.append(np.sqrt(np.diag(at_pods @ P @ at_pods.T)))
    rms, sigma = np.sqrt(np.mean(np.square(errors), axis=0)), np.mean(sigmas, axis=0)
    assert gs.has_master
    assert np.all(rms < 0.03)
    assert np.all(rms < 3.0 * sigma)


ROOT_TALKS: dict[str, Callable[[int], bool]] = {
    "lost for good": lambda k: k < 1500,
    "5 s gap": lambda k: not 1500 <= k < 2000,
    "3 s late": lambda k: k >= 300,
}


@pytest.mark.parametrize("talks", ROOT_TALKS.values(), ids=ROOT_TALKS)
def test_a_root_that_is_lost_or_late_leaves_no_false_confidence(
    config: Config, talks: Callable[[int], bool]
) -> None:
    """GIVEN a turning root, WHEN its IMU is away, THEN no error is beyond 4 own sigmas."""
    settings = settings_from_config(config)
    gs = wing_gs(config, settings)
    shapes = settings.basis.shape(settings.pods_s, 1)[:, 0]
    at_pods = settings.basis.shape(settings.pods_s, settings.basis.bending)
    ratios, sigmas, told = [], [], []
    for k in range(3500):
        root, pods = mean_rates(k, shapes)
        t_ns = k * PERIOD_NS
        if talks(k):
            gs.inputs.add_root(t_ns, root)
        for pod, rate in enumerate(pods):
            gs.inputs.add(pod, t_ns, rate)
        told += gs.advance(t_ns)
        row = gs.estimate_at(t_ns)
        if row is None:
            continue
        found = at_pods @ row.x[settings.basis.phi]
        P = row.P[settings.basis.phi, settings.basis.phi]
        sigmas.append(np.sqrt(np.diag(at_pods @ P @ at_pods.T)))
        ratios.append((found - shapes * wing_rates(k * 0.01, shapes)[0]) / sigmas[-1])
    assert len(sigmas) > 3400
    assert np.max(np.abs(ratios)) < 4.0
    is_back = talks(3499)
    assert np.all(sigmas[-1] < 0.1) == is_back
    assert len(told) == (3 if talks(0) and is_back else 2)


def always(k: int) -> bool:
    return True


def never(k: int) -> bool:
    return False


def fly(config: Config, *, root: Callable[[int], bool], seconds: float = 1.5) -> ListSink:
    sink = ListSink()
    pipeline = Pipelines(config, sink)
    rng = np.random.default_rng(0)
    sample: dict[str, Any] = {"specific_force_m_s2": None, "magnetic_flux_t": None}
    for k in range(int(seconds * 100)):
        t_ns = k * PERIOD_NS
        names = [*config.pod_names, *(["root"] if root(k) else [])]
        for name in names:
            rate = 0.01 * rng.standard_normal(3)
            pipeline.on_imu(ImuSample(t_ns, name, k, rate, **sample), t_ns + 1_000_000)
        pipeline.advance(t_ns + 2_000_000)
    pipeline.close()
    return sink


def told_by(sink: ListSink) -> list[tuple[str, str]]:
    events = [r for _, r, _ in sink.records if isinstance(r, Event) and r.source == "gs"]
    return [(event.level, event.message) for event in events]


@pytest.mark.parametrize("root", [never, always])
def test_rows_stand_among_the_others_and_say_who_the_master_is(
    config: Config, root: Callable[[int], bool]
) -> None:
    sink = fly(config, root=root)
    rows = [r for _, r, _ in sink.records if isinstance(r, WingShapeEstimate)]
    gs = [row for row in rows if row.kind == "gs"]
    crg = [row for row in rows if row.kind == "crg"]
    assert len(gs) > 120
    assert {row.t_ns for row in gs} <= {row.t_ns for row in crg}
    assert gs[-1].bias_rad_s.shape == (len(config.pods), 3)
    assert np.isfinite(gs[-1].phi_rad).all()
    assert np.all(gs[-1].phi_sigma_rad > 0.0)
    assert np.all(np.linalg.eigvalsh(gs[-1].covariance) > -1e-12)
    arrivals = [arrival for _, _, arrival in sink.records]
    assert arrivals == sorted(arrivals)
    told = told_by(sink)
    wanted = "the root IMU" if root is always else "a root at rest"
    assert len(told) == 1
    assert wanted in told[0][1]


def test_a_root_that_falls_silent_and_comes_back_is_told_once(config: Config) -> None:
    sink = fly(config, root=lambda k: not 100 <= k < 200, seconds=3.0)
    assert [level for level, _ in told_by(sink)] == ["info", "warning", "info"]
    _, silent, back = (message for _, message in told_by(sink))
    assert "the root IMU is silent" in silent
    assert "the root IMU is back after" in back


def test_a_short_stall_of_the_root_is_no_news(config: Config) -> None:
    sink = fly(config, root=lambda k: not 100 <= k < 115, seconds=2.0)
    assert len(told_by(sink)) == 1


def test_a_root_that_comes_late_begins_the_filter_anew(config: Config) -> None:
    sink = fly(config, root=lambda k: k >= 100, seconds=2.0)
    (_, first), (level, second) = told_by(sink)
    assert "a root at rest" in first
    assert level == "warning"
    assert "restarted against it" in second
    rows = [r for _, r, _ in sink.records if isinstance(r, WingShapeEstimate) and r.kind == "gs"]
    sigmas = np.array([row.phi_sigma_rad.max() for row in rows])
    assert sigmas[95:].max() > 1.1 * sigmas[90]


def test_without_it_nothing_of_it_is_there(config: Config) -> None:
    alone = fly(config.model_copy(update={"estimators": ("crg",)}), root=never)
    both = fly(config, root=never)

    def others(sink: ListSink) -> list[np.ndarray]:
        return [
            r.phi_rad
            for _, r, _ in sink.records
            if isinstance(r, WingShapeEstimate) and r.kind != "gs"
        ]

    assert not any("gs" in topic for topic, _, _ in alone.records)
    for mine, theirs in zip(others(alone), others(both), strict=True):
        np.testing.assert_array_equal(mine, theirs)
