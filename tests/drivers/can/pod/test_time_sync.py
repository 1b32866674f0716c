"""Pod clocks against the steady clock: offset, drift, rollover, restarts, busy machines."""

import numpy as np
import pytest

from drivers.can.pod.time_sync import PodClock, SyncMaster, unwrap
from tests.drivers.wing_bench import SECOND

START_NS = 100 * SECOND


class Quartz:
    """A pod's clock that is fast by ``ppm`` and read ``start_us`` at ``START_NS``."""

    def __init__(self, ppm: float = 0.0, start_us: int = 0) -> None:
        self.ppm, self.start_us = ppm, start_us

    def us(self, t_ns: int) -> int:
        return self.start_us + int((t_ns - START_NS) * (1 + self.ppm * 1e-6)) // 1000


def feed(clock: PodClock, quartz: Quartz, seconds: float, *, from_s: float = 0.0, delay=None):
    for k in range(round(seconds * 4)):
        t_ns = START_NS + round((from_s + k / 4) * SECOND)
        late_ns = 0 if delay is None else delay()
        clock.add_pair(quartz.us(t_ns + late_ns) % (1 << 32), t_ns)


def error_us(clock: PodClock, quartz: Quartz, at_s: float, *, transit_ns: int = 300_000) -> float:
    t_ns = START_NS + round(at_s * SECOND)
    found = clock.sample_time_ns(quartz.us(t_ns) % (1 << 24), t_ns + transit_ns)
    return (found - t_ns) * 1e-3


@pytest.mark.parametrize(
    ("value", "bits", "expected", "result"),
    [(5, 8, 250, 261), (250, 8, 261, 250), (0, 24, (1 << 24) - 3, 1 << 24), (7, 8, 7, 7)],
)
def test_unwrap_takes_the_nearest_turn(value, bits, expected, result) -> None:
    assert unwrap(value, bits, expected) == result


@pytest.mark.parametrize("ppm", [-100.0, 0.0, 100.0])
@pytest.mark.parametrize("start_us", [0, (1 << 32) - 4_000_000, (1 << 24) - 1])
def test_drifting_clock_is_mapped_within_20_us_across_rollovers(ppm, start_us) -> None:
    clock, quartz = PodClock(), Quartz(ppm, start_us)
    feed(clock, quartz, 40.0)  # the 32-bit counter turns in the second case, the 24-bit one twice
    errors = [error_us(clock, quartz, 39.8 + 0.01 * k) for k in range(60)]
    assert np.abs(errors).max() < 20
    assert clock.drift == pytest.approx(ppm * 1e-6, abs=1e-6)


def test_late_replies_of_a_busy_machine_do_not_bend_the_clock() -> None:
    rng = np.random.default_rng(5)
    clock, quartz = PodClock(), Quartz(50.0)

    def delay() -> int:
        return int(rng.integers(0, 30_000)) if rng.random() > 0.2 else int(rng.integers(2e6, 2e7))

    feed(clock, quartz, 20.0, delay=delay)
    assert abs(error_us(clock, quartz, 20.0)) < 60
    assert clock.counters["sync_outliers"] > 5


def test_restart_of_the_pod_is_taken_up_with_the_second_pair() -> None:
    clock = PodClock()
    feed(clock, Quartz(20.0), 5.0)
    again = Quartz(20.0, start_us=-5_000_000)  # its clock restarted after five seconds
    feed(clock, again, 1.0, from_s=5.0)
    assert clock.counters["clock_restarts"] == 1
    assert abs(error_us(clock, again, 6.0)) < 60


def test_stamp_that_cannot_be_is_replaced_by_the_arrival_and_counted() -> None:
    clock, quartz = PodClock(), Quartz()
    feed(clock, quartz, 5.0)
    t_ns = START_NS + 5 * SECOND
    found = clock.sample_time_ns((quartz.us(t_ns) + 6_000_000) % (1 << 24), t_ns)
    assert found == t_ns
    assert clock.counters["stamp_implausible"] == 1


def test_without_sync_the_earliest_arrival_sets_the_offset() -> None:
    rng = np.random.default_rng(6)
    clock, quartz = PodClock(), Quartz(0.0, 12345)
    errors = []
    for k in range(300):
        t_ns = START_NS + k * 10_000_000
        found = clock.sample_time_ns(
            quartz.us(t_ns), t_ns + 200_000 + int(rng.exponential(500_000))
        )
        errors.append((found - t_ns) * 1e-3)
    assert not clock.is_synchronised
    assert 150 < np.median(errors[100:]) < 400


def test_master_forgets_old_syncs() -> None:
    master = SyncMaster(keep=4)
    for k in range(300):
        master.left(master.next_seq(), k)
    assert master.sent_ns(299 % 256) == 299
    assert master.sent_ns((299 - 4) % 256) is None
