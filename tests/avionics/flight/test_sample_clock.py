import numpy as np
import pytest

from avionics.flight.sample_clock import SampleClock

PERIOD_S = 0.01


def stamped(delay, *, drift: float = -44e-6, count: int = 3000, seed: int = 0) -> np.ndarray:
    """Errors of the recovered times, s, for reads delayed by ``delay(rng, n)``."""
    rng = np.random.default_rng(seed)
    true = 5e-4 + np.arange(count) * PERIOD_S * (1 + drift)
    kept = rng.random(count) > 0.006
    kept[1500:1512] = False
    read = np.sort(true + delay(rng, count))[kept]
    clock = SampleClock(PERIOD_S)
    epoch = 1_700_000_000_000_000_000
    found = [clock.stamp(epoch + round(1e9 * t)) - epoch for t in read]
    assert np.all(np.diff(found) > 0)
    return np.array(found) * 1e-9 - true[kept]


def test_symmetric_jitter_is_averaged_away_through_drops_gap_and_drift() -> None:
    errors = stamped(lambda rng, n: 4e-4 * rng.standard_normal(n))[300:]
    assert np.abs(errors).max() < 1.5e-4
    assert abs(errors.mean()) < 3e-5


def test_milliseconds_of_jitter_leave_tenths() -> None:
    errors = stamped(lambda rng, n: rng.uniform(-3e-3, 3e-3, n))[300:]
    assert np.quantile(np.abs(errors), 0.99) < 5e-4


@pytest.mark.parametrize("seed", range(3))
def test_reads_that_are_always_late_give_their_lower_envelope(seed: int) -> None:
    errors = stamped(lambda rng, n: rng.exponential(1.5e-3, n), seed=seed)[300:]
    # The mean of the reads would be 1.5 ms late.
    assert abs(np.median(errors)) < 2e-4


def test_a_constant_delay_is_no_lateness() -> None:
    errors = stamped(lambda rng, n: 2e-3 + 2e-4 * rng.standard_normal(n))[300:]
    assert np.median(errors) == pytest.approx(2e-3, abs=5e-5)


def test_a_long_silence_begins_a_new_clock() -> None:
    clock = SampleClock(PERIOD_S)
    for i in range(100):
        clock.stamp(10_000_000 * i)
    later = 60_000_000_000 + 3_000_000
    assert clock.stamp(later) == later
    assert clock.resets == 1
