"""RG-WSE: integration of Eq. 7, and a start shape that comes late."""

import numpy as np
import pytest

from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.modes import ModeBasis
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates
from avionics.wse.rg import STEPS_PER_COVARIANCE, GyroIntegrator
from avionics.wse.state import Estimate, RandomWalk, StateLayout

MS = 1_000_000
BASIS = ModeBasis("quarter-sine", 1.5, 1, 1, 0)
PRIOR = np.array([0.07, 0.07])
GYRO_NOISE, BIAS = 2.4e-4, 0.02


def make_rg(keep: int = 60) -> GyroIntegrator:
    layout = StateLayout(BASIS, ("0",), prior=PRIOR, bias=RandomWalk(BIAS))
    process = Process(ModalRates(BASIS, np.array([1.5]), PRIOR), layout, GYRO_NOISE)
    return GyroIntegrator(process, 0, keep=keep)


def step(roll: float, dt: float = 0.01) -> GyroStep:
    return GyroStep(dt, np.array([[roll, 0.0, 0.0]]), Regime((True,), np.ones(3)))


def test_eq7_integrates_the_rate_of_a_pod_at_the_tip() -> None:
    rg = make_rg()
    for i in range(1, 51):
        rg.append(10 * i * MS, step(0.4))
    # The shape is one at the tip: without twist the amplitude turns as the pod does.
    assert rg.t_ns == 500 * MS
    assert rg.estimate.x == pytest.approx([0.4 * 0.5, 0.0, 0.0, 0.0, 0.0])


def test_a_late_start_shape_repeats_only_the_steps_behind_it() -> None:
    rg = make_rg()
    rolls = np.linspace(-1.0, 2.0, 40)
    for i, roll in enumerate(rolls, start=1):
        rg.append(10 * i * MS, step(roll))
    fit = Estimate(np.array([0.1, 0.0]), np.diag([1e-6, 1e-6]))
    rg.start(252 * MS, fit)
    assert rg.is_started
    assert rg.t_ns == 400 * MS
    assert rg.estimate.x[0] == pytest.approx(0.1 + 0.01 * rolls[25:].sum())
    rg.append(410 * MS, step(1.0))
    assert rg.estimate.x[0] == pytest.approx(0.1 + 0.01 * rolls[25:].sum() + 0.01)


def test_biases_stay_zero_and_widen_the_amplitudes() -> None:
    rg = make_rg()
    rg.start(0, Estimate(np.zeros(2), np.zeros((2, 2))))
    count = 10 * STEPS_PER_COVARIANCE
    for i in range(1, count + 1):
        rg.append(10 * i * MS, step(0.0))
    duration_s = 0.01 * count
    expected = (BIAS * duration_s) ** 2 + GYRO_NOISE**2 * duration_s
    assert not rg.estimate.x.any()
    assert rg.estimate.P[0, 0] == pytest.approx(expected)


def test_a_start_older_than_what_is_kept_begins_at_the_oldest_step() -> None:
    rg = make_rg(keep=5)
    for i in range(1, 21):
        rg.append(10 * i * MS, step(1.0))
    rg.start(0, Estimate(np.zeros(2), np.eye(2)))
    assert rg.estimate.x[0] == pytest.approx(5 * 0.01)
