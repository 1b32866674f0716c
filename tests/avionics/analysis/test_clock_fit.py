"""Two clocks aligned by one motion: offset, drift, honest sigma, and what must be refused."""

import numpy as np
import pytest

from avionics.analysis.clock_fit import Rates, fit_clocks
from avionics.errors import JoinError

SECOND = 1_000_000_000


def motion(t_s):
    """A wing that never repeats itself: a chirp on x, another on y, little on z."""
    t_s = np.asarray(t_s)
    x = 2.0 * np.sin(2 * np.pi * (0.3 * t_s + 0.02 * t_s**2))
    y = 0.7 * np.sin(2 * np.pi * (0.9 * t_s + 0.013 * t_s**2) + 1.0)
    return np.stack([x, y, 0.05 * x], axis=1)


def pair(
    offset_s: float, drift: float, *, lag_s: float = 0.006, seed: int = 0, noise: float = 0.01
):
    """True rates on one clock; measured ones on another, late, biased and noisy, with losses."""
    rng = np.random.default_rng(seed)
    start, length = 1000.0, 40.0
    true_s = start + np.arange(0, length, 0.01)
    middle = true_s.mean()
    felt_s = start + 5.0 + np.arange(0, 30.0, 0.01) + rng.uniform(0, 0.002, 3000)
    keep = rng.random(felt_s.size) > 0.05
    felt_s = felt_s[keep]
    rate = motion(felt_s - start) + np.array([0.02, -0.01, 0.005])
    rate += noise * rng.standard_normal(rate.shape)
    rate[rng.random(len(rate)) < 0.002] += 30.0
    read_s = felt_s + offset_s + drift * (felt_s - middle) + lag_s
    true = {"0": Rates(np.rint(true_s * 1e9).astype(np.int64), motion(true_s - start))}
    return {"0": Rates(np.rint(read_s * 1e9).astype(np.int64), rate)}, true


@pytest.mark.parametrize(("offset_s", "drift"), [(0.0, 0.0), (-812.3456789, 40e-6), (3e5, -80e-6)])
def test_offset_and_drift_are_found_within_their_sigma(offset_s: float, drift: float) -> None:
    flown, true = pair(offset_s, drift)
    fit = fit_clocks(flown, true, {"0": 0.006})
    assert fit.offset_ns * 1e-9 == pytest.approx(offset_s, abs=4 * fit.sigma_ns * 1e-9)
    assert fit.drift == pytest.approx(drift, abs=4 * fit.drift_sigma)
    assert fit.sigma_ns < 300_000
    assert fit.drift_sigma < 30e-6


def test_sigma_is_honest() -> None:
    ratios = []
    for seed in range(20):
        flown, true = pair(1.5, 0.0, seed=seed, noise=0.05)
        fit = fit_clocks(flown, true, {"0": 0.006})
        ratios.append((fit.offset_ns - 1.5e9) / fit.sigma_ns)
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_mapping_follows_the_drift() -> None:
    flown, true = pair(2.0, 100e-6, noise=0.0)
    fit = fit_clocks(flown, true, {"0": 0.006})
    for t_s in (1005.0, 1035.0):
        wanted_s = t_s + 2.0 + 100e-6 * (t_s - (1000 + 19.995))
        assert fit.flight_ns(round(t_s * SECOND)) == pytest.approx(wanted_s * 1e9, abs=200_000)


def test_utc_decides_between_equal_swings() -> None:
    t_s = 100 + np.arange(0, 60.0, 0.01)
    rate = np.stack([np.sin(2 * np.pi * t_s), 0 * t_s, 0 * t_s], axis=1)
    true = {"0": Rates(np.rint(t_s * 1e9).astype(np.int64), rate)}
    flown = {"0": Rates(np.rint((t_s[1000:2500] + 7.25) * 1e9).astype(np.int64), rate[1000:2500])}
    fit = fit_clocks(flown, true, {}, expected_ns=7.3e9)
    assert fit.offset_ns == pytest.approx(7.25e9, abs=2e6)


def test_another_motion_is_refused() -> None:
    flown, true = pair(0.0, 0.0)
    rng = np.random.default_rng(5)
    other = np.cumsum(rng.standard_normal(flown["0"].rate_rad_s.shape), axis=0)
    with pytest.raises(JoinError, match="correlate"):
        fit_clocks({"0": Rates(flown["0"].t_ns, other)}, true, {})


def test_logs_without_a_common_pod_are_refused() -> None:
    flown, true = pair(0.0, 0.0)
    with pytest.raises(JoinError, match="none in common"):
        fit_clocks({"7": flown["0"]}, true, {})


@pytest.mark.parametrize("expected_ns", [None, 0.0])
def test_wing_that_lay_still_is_refused(expected_ns: float | None) -> None:
    flown, true = pair(0.0, 0.0)
    still = {"0": Rates(true["0"].t_ns, np.zeros_like(true["0"].rate_rad_s))}
    with pytest.raises(JoinError, match=r"correlate by 0\.00"):
        fit_clocks(flown, still, {}, expected_ns=expected_ns)


def test_a_few_samples_are_refused() -> None:
    flown, true = pair(0.0, 0.0)
    few = {"0": Rates(flown["0"].t_ns[:50], flown["0"].rate_rad_s[:50])}
    with pytest.raises(JoinError, match="less than 2 s"):
        fit_clocks(few, true, {}, expected_ns=0.0)
