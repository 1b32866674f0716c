"""States carried ahead of the gyros, many at once as one by one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.wse.forecast import Forecast, at_ticks
from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates
from avionics.wse.state import Estimate, RandomWalk, StateLayout

PODS = np.array([0.6, 1.2])
LIVE = Regime((True, True), np.array([1.0, 0.5, 0.2]))
ONE = Regime((True, False), np.array([1.0, 0.5, 0.2]))
MS = 1_000_000


@pytest.fixture
def processes(basis) -> tuple[Process, Process]:
    made = []
    for has_unobserved in (True, False):
        prior = np.ones(basis.count)
        layout = StateLayout(
            basis,
            ("0", "1"),
            prior=prior,
            truncation=1e-3,
            bias=RandomWalk(0.02, 1e-5),
            has_unobserved=has_unobserved,
        )
        made.append(Process(ModalRates(basis, PODS, prior), layout, 2.4e-4))
    return made[0], made[1]


def make_forecast(processes, step: GyroStep | None, seed: int = 0, **more) -> Forecast:
    rng = np.random.default_rng(seed)

    def estimate(size: int) -> Estimate:
        return Estimate(0.1 * rng.standard_normal(size), 1e-4 * np.eye(size))

    crg, rg = (process.layout.size for process in processes)
    quiet = {"turn_error": np.zeros((2, 3)), "since_s": 0.02} if step is not None else {}
    return Forecast(10 * MS, estimate(rg), estimate(crg), None, step, **{**quiet, **more})


def turns(dt: float, regime: Regime) -> GyroStep:
    return GyroStep(dt, np.array([[0.5, 0.1, -0.2], [0.9, -0.3, 0.4]]), regime)


def test_a_state_of_the_tick_itself_is_not_moved(processes) -> None:
    forecast = make_forecast(processes, None)
    rg, crg = at_ticks([forecast], *processes)
    assert_allclose(rg.x[0], forecast.rg.x, rtol=0)
    assert_allclose(crg.x[0], forecast.crg.x, rtol=0)
    assert_allclose(crg.P[0], forecast.crg.P, rtol=0)


def test_many_ticks_at_once_equal_one_by_one(processes) -> None:
    steps = [turns(0.01, LIVE), None, turns(0.02, ONE), turns(0.015, LIVE)]
    forecasts = [make_forecast(processes, step, seed) for seed, step in enumerate(steps)]
    rg, crg = at_ticks(forecasts, *processes)
    for i, forecast in enumerate(forecasts):
        rg_alone, crg_alone = at_ticks([forecast], *processes)
        assert_allclose(rg.x[i], rg_alone.x[0], rtol=0, atol=1e-15)
        assert_allclose(crg.x[i], crg_alone.x[0], rtol=0, atol=1e-15)
        assert_allclose(crg.P[i], crg_alone.P[0], rtol=0, atol=1e-15)


def test_states_are_carried_by_the_step_ahead(processes) -> None:
    step = turns(0.02, LIVE)
    forecast = make_forecast(processes, step)
    rg, crg = at_ticks([forecast], *processes)
    process, paper_process = processes
    assert_allclose(crg.x[0], process.move(forecast.crg.x, step)[0], rtol=0, atol=1e-15)
    assert_allclose(rg.x[0], paper_process.move(forecast.rg.x, step)[0], rtol=0, atol=1e-15)


def test_uncertainty_grows_with_time_scale_and_wrong_guesses(processes) -> None:
    step = turns(0.02, LIVE)

    def variance(**more) -> np.ndarray:
        _, crg = at_ticks([make_forecast(processes, step, **more)], *processes)
        return crg.P[0].diagonal()[:6]

    quiet = variance()
    assert np.all(variance(since_s=0.06) > quiet)
    assert np.all(variance(scale=4.0) > quiet)
    # A turn that is wrong by 0.01 rad about x moves bending by the modal inverse of that.
    wrong = np.zeros((2, 3))
    wrong[:, 0] = 1e-4
    inverse = processes[0].rates.inverse(LIVE.live)
    added = variance(turn_error=wrong) - quiet
    assert added[:3] == pytest.approx(1e-4 * (inverse.phi**2).sum(axis=0))
    assert added[3:] == pytest.approx(0.0)
