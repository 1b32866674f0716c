"""Closed loop on made-up truth: bounded with the camera, drifting without, honest, recovering."""

import numpy as np
import pytest

from avionics.config import Pod
from tests.avionics.wse.flight import (
    CAMERA,
    EPOCH_NS,
    Flight,
    ListSink,
    Truth,
    fly,
    make_config,
    project,
    swing,
    tip_errors,
    tip_nees,
)

pytestmark = pytest.mark.slow


def rms_mm(errors: np.ndarray) -> float:
    return 1e3 * float(np.sqrt((errors**2).sum(axis=1).mean()))


def largest_mm(errors: np.ndarray) -> float:
    return 1e3 * float(np.linalg.norm(errors, axis=1).max())


def oblique() -> Truth:
    return Truth(
        bending=swing(0.35, 1.3, rest=0.12, begins=1.0),
        second=swing(0.03, 3.1, begins=1.0),
        twist=swing(0.1, 1.7, begins=1.0),
        inplane=swing(0.12, 0.9, rest=0.03, begins=1.0),
    )


def flown(truth: Truth, config=None, **options) -> tuple[Flight, ListSink]:
    flight = Flight(config or make_config(), truth, **{"duration_s": 8.0, **options})
    return flight, fly(flight.config, flight.events())


def test_camera_bounds_what_gyros_alone_let_drift() -> None:
    # GIVEN a wing that bends, twists and bends in its plane, and gyros with half a degree of bias
    # WHEN it is flown for eight seconds
    flight, sink = flown(oblique())
    # THEN RG-WSE is centimetres off, CRG-WSE stays within millimetres, and says so
    assert rms_mm(tip_errors(flight, sink.estimates("rg"), 4.0)) > 20.0
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 3.0
    assert rms_mm(tip_errors(flight, sink.estimates("crg"), 3.0)) < 5.0
    assert 0.1 < tip_nees(flight, sink.estimates("filtered"), 3.0) < 2.0
    assert 0.1 < tip_nees(flight, sink.estimates("crg"), 3.0) < 3.5


def test_at_rest_the_start_is_found_and_the_biases_follow() -> None:
    # GIVEN a wing at rest, bent by 12 deg at the tip, of which the estimator knows nothing
    def still(t: np.ndarray) -> np.ndarray:
        return np.full_like(t, 0.2)

    truth = Truth(bending=still, second=np.zeros_like)
    # WHEN it is watched for eight seconds
    flight, sink = flown(truth, bias_dps=1.0)
    # THEN the shape is there within the first frames, and the rolling bias within its sigma
    early = [r for r in sink.estimates("filtered") if r.t_ns < EPOCH_NS + 0.5e9]
    assert largest_mm(tip_errors(flight, early, 0.1)) < 5.0
    last = sink.estimates("crg")[-1]
    rng_bias = _true_biases(flight)
    off = (last.bias_rad_s - rng_bias)[:, 0] / last.bias_sigma_rad_s[:, 0]
    assert np.abs(off).max() < 4.0
    assert last.bias_sigma_rad_s[:, 0].max() < 0.5 * np.radians(1.0)


def _true_biases(flight: Flight) -> np.ndarray:
    """Means of what pods at rest measure, rad/s."""
    rates: dict[str, list] = {pod.name: [] for pod in flight.config.pods}
    for _, record in flight.events():
        if hasattr(record, "rate_rad_s"):
            rates[record.pod].append(record.rate_rad_s)
    return np.array([np.mean(rates[name], axis=0) for name in flight.config.pod_names])


@pytest.mark.parametrize("hidden_s", [0.8, 5.0])
def test_markers_hidden_then_seen_again(hidden_s: float) -> None:
    # GIVEN a flight in which no marker is seen for a while from 4 s on
    back_s = 4.0 + hidden_s
    flight, sink = flown(
        oblique(), is_seen=lambda t, k: not 4.0 < t < back_s, duration_s=back_s + 3.0
    )
    rows = sink.estimates("crg")
    # WHEN the markers are away THEN the error grows with its sigma, slower than the swing itself
    away = [r for r in rows if r.t_ns < EPOCH_NS + back_s * 1e9]
    assert largest_mm(tip_errors(flight, away, 4.0)) < 40.0
    sigma = {s: _sigma_at(rows, s) for s in (3.9, back_s)}
    assert sigma[back_s] > 1.2 * sigma[3.9]
    # WHEN they are back THEN half a second later all is as before
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), back_s + 0.5)) < 3.0


def _sigma_at(rows, t_s: float) -> float:
    nearest = min(rows, key=lambda r: abs(r.t_ns - EPOCH_NS - t_s * 1e9))
    return float(nearest.tip_sigma_m[2])


@pytest.mark.parametrize("lost", [0, 1])
def test_a_pod_lost_is_announced_and_flown_without(lost: int) -> None:
    # GIVEN one of two pods silent from 4 s to 7 s
    flight, sink = flown(
        oblique(), is_alive=lambda t, j: not (j == lost and 4.0 < t < 7.0), duration_s=9.0
    )
    # THEN the camera holds the shape, covariance consistent; both changes are reported once
    during = [r for r in sink.estimates("filtered") if r.t_ns < EPOCH_NS + 7e9]
    assert rms_mm(tip_errors(flight, during, 4.3)) < 4.0
    assert tip_nees(flight, during, 4.3) < 3.0
    told = [e.message for e in sink.events() if e.source == f"pod {lost}"]
    assert len(told) == 2
    assert "silent" in told[0]
    assert "back after" in told[1]
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 7.5)) < 3.0


def test_all_pods_lost_leaves_the_camera() -> None:
    flight, sink = flown(oblique(), is_alive=lambda t, j: not 4.0 < t < 5.5)
    during = [r for r in sink.estimates("filtered") if r.t_ns < EPOCH_NS + 5.5e9]
    assert largest_mm(tip_errors(flight, during, 4.0)) < 30.0
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 6.0)) < 3.0


@pytest.mark.parametrize(
    ("pods", "stations"),
    [
        ((1.2,), (0.6, 1.2, 1.5)),
        ((0.4, 0.8, 1.1, 1.4), (0.6, 1.2, 1.5)),
        (tuple(np.linspace(0.18, 1.44, 8)), (0.6, 1.2, 1.5)),
        ((0.6, 1.2), (0.8, 1.4)),
        ((0.6, 1.2), (1.3,)),
        ((0.6, 1.2), (0.3, 0.6, 0.9, 1.2, 1.5)),
    ],
)
def test_any_number_of_pods_and_markers(pods, stations) -> None:
    config = make_config(pods, stations)
    flight, sink = flown(oblique(), config, duration_s=5.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 5.0
    assert tip_nees(flight, sink.estimates("filtered"), 3.0) < 2.5


def test_no_pods_at_all_is_a_camera_filter() -> None:
    config = make_config((), (0.6, 1.2, 1.5))
    truth = Truth(bending=swing(0.3, 0.8, rest=0.1, begins=1.0), second=np.zeros_like)
    flight, sink = flown(truth, config, duration_s=6.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 5.0


def test_a_swept_wing() -> None:
    camera = CAMERA.model_copy(update={"pan_deg": 15.0})
    config = make_config(psi0_deg=20.0, camera=camera)
    truth = oblique()
    truth.psi0 = np.radians(20.0)
    flight, sink = flown(truth, config, duration_s=6.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 3.0


def test_a_left_wing_is_the_mirrored_right_one() -> None:
    # GIVEN the same truth mirrored in y, seen by a camera turned around, with mirrored gyros
    camera = CAMERA.model_copy(
        update={"pan_deg": 178.0, "tilt_deg": -14.0, "r_in_body_m": (0.03, 0.02, -0.3)}
    )
    config = make_config(side="left", camera=camera)
    flight = Flight(config, oblique(), duration_s=5.0)
    events = []
    for arrival_ns, record in flight.events():
        if hasattr(record, "rate_rad_s"):
            record.rate_rad_s[:] = record.rate_rad_s * [-1.0, 1.0, -1.0]
        events.append((arrival_ns, record))
    sink = fly(config, events)
    rows = sink.estimates("filtered")
    assert rows[-1].line_in_body_m[-1, 1] < -1.2
    assert rms_mm(tip_errors(flight, rows, 3.0)) < 3.0
    # The reported bias is the sensor's, in its own axes' signs.
    assert np.isfinite(rows[-1].bias_rad_s).all()


def test_sensor_to_station_rotation_is_applied() -> None:
    turned = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    config = make_config()
    pods = tuple(Pod(id=p.id, s_m=p.s_m, R_sensor_from_local=turned) for p in config.pods)
    config = config.model_copy(update={"pods": pods})
    flight, sink = flown(oblique(), config, duration_s=5.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 3.0


@pytest.mark.parametrize("offset_s", [0.04, -0.02])
def test_a_camera_clock_that_is_off_is_found(offset_s: float) -> None:
    flight, sink = flown(oblique(), camera_offset_s=offset_s, duration_s=6.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 4.0)) < 4.0


def test_a_camera_clock_that_is_off_and_not_looked_for_is_felt_unless_told() -> None:
    blind = make_config(time_offset=False)
    flight, sink = flown(oblique(), blind, camera_offset_s=0.02, duration_s=5.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) > 10.0
    told = make_config(time_offset=False, camera=CAMERA.model_copy(update={"time_offset_s": 0.02}))
    flight, sink = flown(oblique(), told, camera_offset_s=0.02, duration_s=5.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 3.0


def test_readers_that_are_always_late_are_timed_by_their_envelope() -> None:
    flight, sink = flown(oblique(), always_late_s=0.0015, duration_s=9.0)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 5.0)) < 3.5


def test_a_false_light_taken_for_a_marker_is_gated() -> None:
    # GIVEN marker 5 tracked 40 px away from where it is for a second
    flight = Flight(make_config(), oblique(), duration_s=7.0)
    events = []
    for arrival_ns, record in flight.events():
        if hasattr(record, "pixel") and 4e9 < record.t_ns - EPOCH_NS < 5e9:
            record.pixel[5] += [40.0, -25.0]
        events.append((arrival_ns, record))
    sink = fly(flight.config, events)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 3.0)) < 3.0
    assert sink.health("camera root")["markers_gated"] >= 25


def test_a_wrong_lock_is_noticed_reported_and_left() -> None:
    # GIVEN every marker tracked on the picture of another shape for 0.6 s, then truly again
    flight = Flight(make_config(), oblique(), duration_s=8.0)
    wrong = Truth(bending=lambda t: np.full_like(t, -0.5), second=np.zeros_like)
    placed = [(m.s_m, m.x_m, m.z_m) for m in flight.config.markers]
    lie = project(CAMERA, wrong.points(np.zeros(1), placed))[0]
    events = []
    for arrival_ns, record in flight.events():
        if hasattr(record, "pixel") and 4e9 < record.t_ns - EPOCH_NS < 4.6e9:
            record.pixel[:] = lie
            record.found[:] = True
            record.sigma_px[:] = 0.3
        events.append((arrival_ns, record))
    # WHEN it is flown
    sink = fly(flight.config, events)
    # THEN the jump and the way back are in the log, and the shape is right again
    told = [e.message for e in sink.events() if e.source == "estimator"]
    assert any("rejected" in m for m in told)
    assert any("acquired again" in m for m in told)
    assert rms_mm(tip_errors(flight, sink.estimates("filtered"), 6.5)) < 4.0


def test_paper_form_is_bounded_where_its_model_is_wrong() -> None:
    config = make_config(form="paper")
    truth = Truth(bending=swing(0.35, 1.3, rest=0.12, begins=1.0), second=np.zeros_like)
    flight, sink = flown(truth, config, duration_s=14.0)
    rg = rms_mm(tip_errors(flight, sink.estimates("rg"), 10.0))
    crg = rms_mm(tip_errors(flight, sink.estimates("crg"), 10.0))
    assert crg < 35.0
    assert rg > 1.5 * crg
