"""Flexure: closed-form transition, stationary law, and the sampled process itself."""

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from avionics.pos.flexure import MARKOV_BETA, Flexure, discretise, markov_flexure, sample_flexure

TAU = np.array([2.0, 5.0, 2.0])
SIGMA = np.array([1.7e-3, 6.8e-3, 1.7e-3])


def test_markov_transition_is_the_closed_form() -> None:
    T = 0.01
    Phi, _ = discretise(markov_flexure(TAU, SIGMA), T)
    for j, tau in enumerate(TAU):
        b = MARKOV_BETA / tau
        expected = np.exp(-b * T) * np.array([[1 + b * T, T], [-b * b * T, 1 - b * T]])
        np.testing.assert_allclose(Phi[j], expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    "law",
    [
        markov_flexure(TAU, SIGMA),
        Flexure(np.array([12.4]), np.array([0.03]), np.array([3.5e-3])),
    ],
)
def test_noise_is_the_integral_and_keeps_the_stationary_law(law: Flexure) -> None:
    T = 0.05
    Phi, Q = discretise(law, T)
    for j in range(len(law.frequency)):
        w, zeta = law.frequency[j], law.damping[j]
        F = np.array([[0.0, 1.0], [-w * w, -2 * zeta * w]])
        G = np.diag([0.0, law.psd[j]])
        integral, _ = quad_vec(lambda s, F=F, G=G: expm(F * s) @ G @ expm(F * s).T, 0.0, T)
        np.testing.assert_allclose(Q[j], integral, rtol=1e-6, atol=1e-18)
        stationary = np.diag([law.sigma[j] ** 2, law.rate_sigma[j] ** 2])
        kept = Phi[j] @ stationary @ Phi[j].T + Q[j]
        np.testing.assert_allclose(kept, stationary, rtol=1e-9, atol=1e-17)


def test_samples_have_the_stationary_sigmas_and_start_in_them() -> None:
    law = markov_flexure(np.array([0.5]), np.array([2e-3]))
    rng = np.random.default_rng(3)
    theta, rate = sample_flexure(law, 0.01, 100_000, rng)
    # 1000 s hold about 700 independent samples of this process.
    assert theta.std() == pytest.approx(2e-3, rel=0.12)
    assert rate.std() == pytest.approx(law.rate_sigma[0], rel=0.12)
    starts = np.array([sample_flexure(law, 0.01, 1, rng)[0][0, 0] for _ in range(400)])
    assert starts.std() == pytest.approx(2e-3, rel=0.12)


def test_a_stiff_axis_stays_at_rest() -> None:
    law = Flexure(np.array([1.0]), np.array([1.0]), np.array([0.0]))
    theta, rate = sample_flexure(law, 0.01, 50, np.random.default_rng(0))
    assert not theta.any()
    assert not rate.any()
