"""Counters and events: spikes, losses, repeats, silence; each in the account of its source."""

import numpy as np
import pytest

from avionics.config import Estimator, Pod
from avionics.flight.health import HealthLog
from avionics.flight.imu_channel import ImuChannel, SpikeScreen
from drivers.samples import ImuSample
from tests.avionics.wse.flight import EPOCH_NS, Flight, ListSink, Truth, fly, make_config, swing

MS = 1_000_000
FLIPPED_RAD_S = np.radians(2048.0)


def make_channel(sink: ListSink) -> ImuChannel:
    pod = Pod(id=1, s_m=0.6)
    return ImuChannel("pod 1", pod, Estimator(), is_mirrored=False, health=HealthLog(sink))


def sample(t_ms: float, rate, seq: int = 0) -> ImuSample:
    return ImuSample(EPOCH_NS + round(t_ms * MS), "1", seq, np.asarray(rate, dtype=float))


def swinging(hz: float, amplitude: float, seconds: float) -> np.ndarray:
    t = np.arange(0, seconds, 0.01)
    rng = np.random.default_rng(0)
    return amplitude * np.sin(2 * np.pi * hz * t) + 2e-3 * rng.standard_normal(len(t))


def test_a_flipped_sign_bit_is_rejected_alone() -> None:
    screen, rates = SpikeScreen(), swinging(3.0, 2.0, 3.0)
    rates[150] -= FLIPPED_RAD_S
    passed = [screen.passes(np.array([r, 0.0, 0.0])) for r in rates]
    assert [i for i, ok in enumerate(passed) if not ok] == [150]


def test_fast_motion_and_a_strike_pass_the_screen() -> None:
    # 6 Hz at 150 deg/s, and a blow that steps the rate by 200 deg/s and rings on.
    for rates in (swinging(6.0, 2.6, 3.0), np.r_[np.zeros(50), 3.5 * np.cos(np.arange(80) * 0.3)]):
        screen = SpikeScreen()
        passed = [screen.passes(np.array([r, 0.0, 0.0])) for r in rates]
        assert passed.count(False) <= 1


def test_a_new_level_is_believed_when_it_stays() -> None:
    screen = SpikeScreen()
    rates = np.r_[np.zeros(20), np.full(20, 20.0)]
    passed = [screen.passes(np.array([r, 0.0, 0.0])) for r in rates]
    assert passed[20:].count(False) == 3


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_rates_that_are_no_numbers_are_rejected_and_told(bad: float) -> None:
    sink = ListSink()
    channel = make_channel(sink)
    assert channel.take(sample(0, [0, 0, 0]), EPOCH_NS) is not None
    assert channel.take(sample(10, [bad, 0, 0]), EPOCH_NS + 10 * MS) is None
    assert "rejected" in sink.events()[0].message


def test_losses_are_counted_by_number_and_by_time() -> None:
    sink = ListSink()
    health = HealthLog(sink)
    channel = ImuChannel("pod 1", Pod(id=1, s_m=0.6), Estimator(), is_mirrored=False, health=health)
    channel.take(sample(0, [0.1, 0, 0], seq=0), EPOCH_NS)
    channel.take(sample(10, [0.2, 0, 0], seq=4), EPOCH_NS)
    channel.take(sample(40, [0.3, 0, 0], seq=5), EPOCH_NS)
    health.write_counters(EPOCH_NS, is_last=True)
    assert sink.health("pod 1")["lost"] == 3 + 2


def test_a_repeated_sample_is_skipped_but_a_resting_sensor_is_not() -> None:
    channel = make_channel(ListSink())
    taken = [
        channel.take(sample(10 * i, rate), EPOCH_NS + 10 * i * MS) is not None
        for i, rate in enumerate([[0.1, 0, 0], [0.1, 0, 0], [0.2, 0, 0], *[[0.3, 0, 0]] * 6])
    ]
    assert taken == [True, False, True, True, False, True, False, True, False]


def test_older_samples_are_counted_as_disordered() -> None:
    sink = ListSink()
    health = HealthLog(sink)
    channel = ImuChannel("pod 1", Pod(id=1, s_m=0.6), Estimator(), is_mirrored=False, health=health)
    assert channel.take(sample(10, [0.1, 0, 0]), EPOCH_NS) is not None
    assert channel.take(sample(5, [0.2, 0, 0]), EPOCH_NS) is None
    health.write_counters(EPOCH_NS, is_last=True)
    assert sink.health("pod 1")["disordered"] == 1


@pytest.mark.parametrize(
    ("settings", "lag_ms"),
    [
        # sqrt(2) / (2 pi 32 Hz) = 7.03 ms, and half of the 10 ms that a fusion register stands.
        ({}, 12.0337),
        ({"gyro_lag_s": "filter"}, 7.0337),
        ({"gyro_lag_s": 0.002}, 2.0),
        ({"form": "paper"}, 0.0),
        ({"form": "paper", "gyro_lag_s": "filter"}, 0.0),
        ({"form": "paper", "gyro_lag_s": 0.002}, 2.0),
    ],
)
def test_the_lag_of_the_chip_is_taken_off_the_sample_time(settings, lag_ms) -> None:
    pod, estimator, log = Pod(id=1, s_m=0.6), Estimator(**settings), HealthLog(ListSink())
    channel = ImuChannel("pod 1", pod, estimator, is_mirrored=False, health=log)
    t_ns, _ = channel.take(sample(0, [0.1, 0, 0]), EPOCH_NS)
    assert (EPOCH_NS - t_ns) * 1e-6 == pytest.approx(lag_ms, rel=1e-3)


def test_accounts_come_once_a_second_for_every_source() -> None:
    truth = Truth(bending=swing(0.2, 1.0, begins=0.2))
    flight = Flight(make_config(), truth, duration_s=3.0)
    sink = fly(flight.config, flight.events())
    records = sink.records["/health"]
    assert {r.source for r in records} >= {"pod 0", "pod 1", "camera root"}
    times = sorted({r.t_ns for r in records if r.source == "pod 0"})[:-1]
    assert np.all(np.diff(times) == 1_000_000_000)
    assert sink.health("camera root")["frames"] == 90


def test_a_spike_on_the_bus_does_not_reach_the_estimate() -> None:
    # GIVEN sign bits flipped in one of a hundred samples
    truth = Truth(bending=swing(0.25, 1.2, begins=0.5))
    flight = Flight(make_config(), truth, duration_s=4.0)
    events, flipped = flight.events(), 0
    for i, (_, record) in enumerate(events):
        if isinstance(record, ImuSample) and i > 200 and i % 100 == 0:
            record.rate_rad_s[i // 100 % 3] -= FLIPPED_RAD_S
            flipped += 1
    # WHEN it is flown THEN each is counted and reported, and the tip stays where it is
    sink = fly(flight.config, events)
    spikes = sink.health("pod 0")["spikes"] + sink.health("pod 1")["spikes"]
    assert spikes >= flipped
    rows = [r for r in sink.estimates("filtered") if 2e9 < r.t_ns - EPOCH_NS < 4e9]
    tips = np.array([r.line_in_body_m[-1] for r in rows])
    assert np.abs(tips - flight.tip([r.t_ns for r in rows])).max() < 5e-3
    assert spikes <= flipped + 2
