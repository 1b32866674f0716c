import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates
from avionics.wse.state import RandomWalk, StateLayout

PODS = np.array([0.6, 1.2])
BIAS = RandomWalk(0.02, 1e-5)
LIVE = Regime((True, True), np.array([1.0, 0.5, 0.2]))


def make_process(basis, **options) -> Process:
    prior = np.ones(basis.count)
    layout = StateLayout(
        basis, ("0", "1"), prior=prior, truncation=1e-3, **{"bias": BIAS, **options}
    )
    return Process(ModalRates(basis, PODS, prior), layout, 2.4e-4)


def make_steps(count: int, dt: float = 0.01) -> list[GyroStep]:
    rng = np.random.default_rng(4)
    return [GyroStep(dt, rng.normal(size=(2, 3)), LIVE) for _ in range(count)]


def test_midpoint_rule_is_of_second_order(basis, q) -> None:
    process = make_process(basis, bias=None)
    rates = np.array([[0.9, 0.4, -0.3], [1.3, -0.5, 0.6]])

    def after(pieces: int) -> np.ndarray:
        x = q
        for _ in range(pieces):
            x, _ = process.move(x, GyroStep(0.5 / pieces, rates, LIVE))
        return x

    truth = after(4096)
    errors = [np.abs(after(n) - truth).max() for n in (16, 32, 64)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)


def test_eqs9_to_11_against_finite_differences(basis, q) -> None:
    process = make_process(basis)
    step = make_steps(1)[0]
    n, size = 6, process.layout.size
    x = np.concatenate([q, np.full(6, 0.01)])
    _, middle = process.move(x, step)
    h = 1e-6

    def slope(dx: np.ndarray, rates: np.ndarray) -> np.ndarray:
        def f(sign: float) -> np.ndarray:
            bent = GyroStep(step.dt, step.rates + sign * rates, LIVE)
            start = np.concatenate([middle, x[n:]]) + sign * dx
            return process.amplitude_rates(start, bent)

        return (f(1.0) - f(-1.0)) / (2 * h)

    A = np.column_stack([slope(h * e, np.zeros((2, 3))) for e in np.eye(size)[:n]])
    G = np.column_stack([slope(np.zeros(size), h * e.reshape(2, 3)) for e in np.eye(6)])
    F = np.eye(size)
    F[:n, :n] += A * step.dt
    F[:n, n:] = -G * step.dt
    Q = np.diag([1e-6 * step.dt] * n + [1e-10 * step.dt] * 6)
    Q[:n, :n] += G @ G.T * 2.4e-4**2 * step.dt
    P = np.diag(np.linspace(0.01, 0.02, size))
    (found,) = process.spread(P, x, [middle], [step])
    assert_allclose(found, F @ P @ F.T + Q, atol=1e-10)


def test_a_batch_of_steps_equals_single_steps(basis, q) -> None:
    process = make_process(basis, has_unobserved=True, offset=RandomWalk(0.02, 1e-4))
    steps = make_steps(7)
    steps[3] = GyroStep(0.004, steps[3].rates, Regime((True, False), LIVE.activity))
    x = np.zeros(process.layout.size)
    x[:6] = q
    P = 1e-3 * np.eye(process.layout.size)
    states, covariances = process.run(x, P, steps)
    for step, state, covariance in zip(steps, states, covariances, strict=True):
        (x,), (P,) = process.run(x, P, [step])
        assert_allclose(x, state, rtol=0, atol=1e-15)
        assert_allclose(P, covariance, rtol=0, atol=1e-15)


def test_unobserved_rates_fade_and_reach_their_stationary_variance(basis) -> None:
    process = make_process(basis, bias=None, has_unobserved=True)
    quiet = [GyroStep(0.01, np.zeros((2, 3)), LIVE)] * 200
    x = np.zeros(12)
    x[6] = 0.5
    states, covariances = process.run(x, np.zeros((12, 12)), quiet)
    assert states[9][6] == pytest.approx(0.5 * np.exp(-1.0))
    assert states[-1][0] == pytest.approx(0.5 * 0.1, rel=1e-6)
    unobserved = ModalRates(basis, PODS, np.ones(6)).inverse((True, True)).unobserved
    expected = unobserved.diagonal() * np.repeat(LIVE.activity, [3, 2, 1])
    assert_allclose(covariances[-1].diagonal()[6:], expected, rtol=1e-9)
