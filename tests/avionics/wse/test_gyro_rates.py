import numpy as np
import pytest

from avionics.wse.gyro_rates import GyroInputs, RateTrack
from avionics.wse.modes import ModeBasis
from avionics.wse.rates import ModalRates

MS = 1_000_000


def track(*samples: tuple[int, float]) -> RateTrack:
    made = RateTrack(35 * MS)
    for t_ms, value in samples:
        assert made.add(t_ms * MS, np.full(3, value))
    return made


def test_rates_are_linear_between_and_beyond_samples() -> None:
    made = track((0, 0.0), (10, 1.0), (20, 3.0))
    assert made.at(5 * MS)[0] == pytest.approx(0.5)
    assert made.at(15 * MS)[0] == pytest.approx(2.0)
    assert made.at(25 * MS)[0] == pytest.approx(4.0)


def test_mean_is_the_integral_of_the_polygon() -> None:
    made = track((0, 0.0), (10, 1.0), (20, 3.0))
    # 5..10: mean 0.75; 10..20: 2; 20..26 extrapolated: 3.6.
    expected = (5 * 0.75 + 10 * 2.0 + 6 * 3.6) / 21
    assert made.mean(5 * MS, 26 * MS)[0] == pytest.approx(expected)


def test_a_gap_is_neither_covered_nor_joined() -> None:
    made = track((0, 0.0), (10, 1.0), (60, 9.0), (70, 9.0))
    assert made.covers(0, 10 * MS)
    assert not made.covers(5 * MS, 65 * MS)
    assert made.at(40 * MS)[0] == pytest.approx(1.0)


def test_older_samples_are_refused() -> None:
    made = track((0, 0.0), (10, 1.0))
    assert not made.add(10 * MS, np.zeros(3))
    assert not made.add(5 * MS, np.zeros(3))


def make_inputs() -> GyroInputs:
    basis = ModeBasis("quarter-sine", 1.5, 1, 1, 0)
    return GyroInputs(ModalRates(basis, np.array([0.6, 1.2]), np.ones(2)), 10 * MS)


def test_what_is_known_ends_at_the_slowest_live_pod() -> None:
    inputs = make_inputs()
    for t in range(0, 100, 10):
        inputs.add(0, t * MS, np.zeros(3))
    for t in range(3, 80, 10):
        inputs.add(1, t * MS, np.zeros(3))
    assert inputs.known_until(95 * MS) == 73 * MS
    # A pod that is silent for five periods is waited for no longer.
    assert inputs.known_until(125 * MS) == 90 * MS
    assert inputs.known_until(200 * MS) == 150 * MS


def test_a_start_waits_for_every_pod_but_not_for_ever() -> None:
    inputs = make_inputs()
    assert inputs.first_known_ns(0) is None
    inputs.add(0, 0, np.zeros(3))
    assert inputs.first_known_ns(50 * MS) is None
    assert inputs.first_known_ns(101 * MS) == 0
    inputs.add(1, 60 * MS, np.zeros(3))
    assert inputs.first_known_ns(61 * MS) == 60 * MS
