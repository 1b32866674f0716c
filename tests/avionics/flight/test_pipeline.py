"""The path of records: order, causality, equality of late and in-order frames, replay."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.flight.pipelines import Pipelines
from avionics.records import MarkerTracks
from drivers.samples import ImuSample
from tests.avionics.wse.flight import (
    EPOCH_NS,
    Flight,
    ListSink,
    Truth,
    fly,
    make_config,
    swing,
)

pytestmark = pytest.mark.slow

TICK_NS = 10_000_000


@pytest.fixture(scope="module")
def flight() -> Flight:
    truth = Truth(bending=swing(0.3, 1.3, rest=0.1, begins=0.5), twist=swing(0.08, 1.7, begins=0.5))
    return Flight(make_config(), truth, duration_s=4.0)


@pytest.fixture(scope="module")
def sink(flight: Flight) -> ListSink:
    return fly(flight.config, flight.events())


def same(a, b) -> bool:
    names = a.__dataclass_fields__
    return all(
        np.array_equal(np.asarray(getattr(a, n)), np.asarray(getattr(b, n)), equal_nan=True)
        if isinstance(getattr(a, n), np.ndarray | float)
        else getattr(a, n) == getattr(b, n)
        for n in names
    )


def test_one_row_of_each_estimator_per_tick(sink: ListSink) -> None:
    for kind in ("rg", "crg"):
        t = np.array([r.t_ns for r in sink.estimates(kind)])
        assert np.all(np.diff(t) == TICK_NS)
        assert np.all(t % TICK_NS == 0)


def test_what_arrives_is_written_before_what_it_makes_and_in_order(flight, sink) -> None:
    arrivals = [arrival for _, arrival in sink.order]
    assert arrivals == sorted(arrivals)
    received = [record for _, record in flight.events()]
    assert len(sink.records["/imu/0"]) == sum(
        isinstance(r, ImuSample) and r.pod == "0" for r in received
    )
    tracks = [r for r in received if isinstance(r, MarkerTracks)]
    assert len(sink.records["/camera/root/tracks"]) == len(tracks)


def test_every_frame_has_its_filtered_estimate_at_its_own_time(sink: ListSink) -> None:
    exposures = {r.t_ns for r in sink.records["/camera/root/tracks"]}
    filtered = [r.t_ns for r in sink.estimates("filtered")]
    assert set(filtered) <= exposures
    assert len(filtered) >= len(exposures) - 2


def test_full_covariance_comes_at_ten_hertz(sink: ListSink) -> None:
    rows = sink.estimates("crg")
    with_covariance = [r.t_ns for r in rows if r.covariance is not None]
    assert np.all(np.diff(with_covariance) == 10 * TICK_NS)
    row = next(r for r in rows if r.covariance is not None and r.t_ns > EPOCH_NS + 2e9)
    sigma = np.concatenate(
        [row.phi_sigma_rad, row.theta_sigma_rad, row.psi_sigma_rad, row.bias_sigma_rad_s.ravel()]
    )
    assert_allclose(np.sqrt(row.covariance.diagonal()), sigma, rtol=1e-12)


def test_two_runs_over_the_same_events_are_identical(flight, sink) -> None:
    again = fly(flight.config, flight.events())
    assert again.order == sink.order
    for kind in ("rg", "crg", "filtered"):
        pairs = zip(again.estimates(kind), sink.estimates(kind), strict=True)
        assert all(same(a, b) for a, b in pairs)


def test_a_row_depends_on_nothing_that_arrived_after_it(flight, sink) -> None:
    cut_ns = EPOCH_NS + 2_500_000_000
    first = fly(flight.config, [e for e in flight.events() if e[0] <= cut_ns])
    for kind in ("rg", "crg"):
        early = [r for r in first.estimates(kind) if r.t_ns <= cut_ns]
        pairs = zip(early, sink.estimates(kind), strict=False)
        assert all(same(a, b) for a, b in pairs)
        assert len(early) > 200


def with_latencies(events, latency_s) -> list:
    """The same records, each frame exposed before 2.4 s arriving ``latency_s(i)`` later."""
    changed = []
    for arrival_ns, record in events:
        if isinstance(record, ImuSample):
            changed.append((arrival_ns, record))
        elif record.t_ns < EPOCH_NS + 2_400_000_000:
            late_ns = round(1e9 * latency_s(record.frame_index))
            changed.append((record.t_ns + late_ns, record))
    return sorted(changed, key=lambda item: item[0])


@pytest.mark.parametrize("form", ["general", "paper"])
def test_late_and_disordered_frames_equal_frames_in_order(flight, form: str) -> None:
    config = make_config(form=form)
    latency_s = np.random.default_rng(7).uniform(0.035, 0.45, 100)
    prompt = fly(config, with_latencies(flight.events(), lambda _: 0.03))
    late = fly(config, with_latencies(flight.events(), lambda i: latency_s[i]))
    order = [r.t_ns for r in late.estimates("filtered")]
    assert order != sorted(order)
    assert sorted(order) == [r.t_ns for r in prompt.estimates("filtered")]
    compared = 0
    for a, b in zip(prompt.estimates("crg"), late.estimates("crg"), strict=True):
        if a.t_ns < EPOCH_NS + 3_000_000_000:
            continue
        compared += 1
        for name in ("phi_rad", "theta_rad", "psi_rad", "bias_rad_s", "phi_sigma_rad"):
            assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=1e-9)
        # A milliradian is about a pixel: 1e-6 px is the same bound.
        assert_allclose(a.marker_px, b.marker_px, rtol=0, atol=1e-6)
    assert compared > 90


def test_frames_older_than_the_history_are_counted_not_used(flight) -> None:
    late = fly(make_config(), with_latencies(flight.events(), lambda i: 1.2 if i == 30 else 0.04))
    assert late.health("camera root")["too_old"] == 1
    assert len(late.estimates("filtered")) == late.health("camera root")["frames"] - 1


def test_fusing_at_arrival_is_worse_than_rewinding(flight) -> None:
    def error(late_frames: str) -> float:
        config = make_config(late_frames=late_frames, time_offset=False)
        rows = fly(config, flight.events()).estimates("crg")
        t = np.array([r.t_ns for r in rows if 2e9 < r.t_ns - EPOCH_NS < 3.9e9])
        tips = np.array([r.line_in_body_m[-1] for r in rows if 2e9 < r.t_ns - EPOCH_NS < 3.9e9])
        return float(np.sqrt(np.mean((tips - flight.tip(t)) ** 2)))

    assert error("arrival") > 2.5 * error("rewind")


def test_markers_are_predicted_before_during_and_ahead(flight) -> None:
    sink = ListSink()
    pipeline = Pipelines(flight.config, sink)
    start = pipeline.predict_markers(EPOCH_NS)
    assert np.isfinite(start.pixel).all()
    assert np.sqrt(start.covariance_px2[:, 1, 1].min()) > 20
    stop_ns = EPOCH_NS + 3_000_000_000
    tracks = []
    for arrival_ns, record in flight.events():
        if isinstance(record, ImuSample):
            if arrival_ns < stop_ns:
                pipeline.on_imu(record, arrival_ns)
        else:
            tracks.append(record)
            if arrival_ns < stop_ns:
                pipeline.on_tracks(record, arrival_ns)
    for ahead_s in (-0.1, 0.0, 0.015):
        nearest = min(tracks, key=lambda r: abs(r.t_ns - stop_ns - ahead_s * 1e9))
        prediction = pipeline.predict_markers(nearest.t_ns)
        seen = nearest.found
        miss = prediction.pixel[seen] - nearest.pixel[seen]
        assert np.abs(miss).max() < 6.0


def test_without_a_camera_the_gyros_go_on(flight) -> None:
    config = make_config(camera=None)
    gyros = [e for e in flight.events() if isinstance(e[1], ImuSample)]
    rows = fly(config, gyros).estimates("crg")
    assert np.isnan(rows[-1].marker_px).all()
    assert np.isfinite(rows[-1].line_in_body_m).all()


def test_unknown_pods_are_counted_and_recorded(flight) -> None:
    sink = ListSink()
    pipeline = Pipelines(flight.config, sink)
    pipeline.on_imu(ImuSample(EPOCH_NS, "9", 0, np.zeros(3)), EPOCH_NS)
    pipeline.advance(EPOCH_NS + 1_500_000_000)
    pipeline.close()
    pipeline.close()
    assert sink.health("pod 9")["unknown"] == 1
    assert len(sink.records["/imu/9"]) == 1


def test_rows_go_on_when_the_events_are_those_of_the_paper(flight) -> None:
    sink = fly(make_config(form="paper"), flight.events())
    row = sink.estimates("crg")[-1]
    assert (len(row.phi_rad), len(row.theta_rad), len(row.psi_rad)) == (1, 1, 0)
    assert np.isnan(row.bias_rad_s).all()
    assert row.basis == "quarter-sine/1+1+0"


def test_rows_made_singly_equal_rows_made_together(flight, sink) -> None:
    config = make_config(rows_at_once=1)
    events = flight.events()[:300]
    single, together = fly(config, events), fly(flight.config, events)
    assert single.order == together.order
    for kind in ("rg", "crg"):
        for a, b in zip(single.estimates(kind), together.estimates(kind), strict=True):
            assert_allclose(a.marker_px, b.marker_px, rtol=0, atol=1e-9)
            assert_allclose(a.marker_sigma_px, b.marker_sigma_px, rtol=1e-9)
            assert_allclose(a.phi_rad, b.phi_rad, rtol=0, atol=1e-12)


def test_a_jump_of_the_clock_begins_anew_without_a_million_rows(flight) -> None:
    jump_ns = 3_600_000_000_000
    first, later = flight.events()[:300], []
    for arrival_ns, record in flight.events()[300:900]:
        moved = replace(record, t_ns=record.t_ns + jump_ns)
        later.append((arrival_ns + jump_ns, moved))
    sink = fly(flight.config, first + later)
    t = np.array([r.t_ns for r in sink.estimates("crg")])
    assert np.all(np.diff(t) > 0)
    assert len(t) < 500
    assert any("estimators restart" in e.message for e in sink.events())
    assert np.isfinite(sink.estimates("crg")[-1].tip_sigma_m).all()
    assert sink.estimates("crg")[-1].tip_sigma_m.max() < 0.02


def test_samples_that_come_late_are_counted_and_told_of_once(flight) -> None:
    # GIVEN samples from the second second that were held up until the third
    held = (EPOCH_NS + 1_000_000_000, EPOCH_NS + 2_000_000_000)
    events = [
        (max(arrival, held[1]) if held[0] < arrival < held[1] else arrival, record)
        for arrival, record in flight.events()
    ]
    # WHEN they are flown
    sink = fly(flight.config, sorted(events, key=lambda item: item[0]))
    # THEN those that the estimator could not wait for are counted and reported
    told = [event.message for event in sink.events() if event.source == "pod 0"]
    assert [word in message for word, message in zip(
        ("silent", "back after", "s late", "in time again"), told, strict=True
    )] == [True] * 4  # fmt: skip
    assert 85 <= sink.health("pod 0")["late"] <= 100
    assert sink.health("pod 0")["disordered"] == 0
