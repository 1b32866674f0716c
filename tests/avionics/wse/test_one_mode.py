"""One bending and one twist mode in plain numbers: Eqs. 4, 6 and 7, and the midpoint rule."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.wse.one_mode import PodWeights, midpoint, modal_rates

PODS = [PodWeights(0, 0.6, 0.5, 0.7, 0.9), PodWeights(3, 0.9, 0.8, 0.4, 0.3)]


def angle_rates(phi: float, theta: float, rates: np.ndarray) -> np.ndarray:
    """Return the local angles' rates of a pod, by Eq. 4 as matrices."""
    H = [
        [1.0, np.sin(phi) * np.tan(theta), np.cos(phi) * np.tan(theta)],
        [0.0, np.cos(phi), -np.sin(phi)],
    ]
    return np.array(H) @ rates


def test_eq6_eq7_weighted_sum_of_the_pods_angle_rates() -> None:
    omega = np.random.default_rng(3).normal(size=(2, 3))
    phi, theta = 0.35, -0.2
    expected = np.zeros(2)
    for pod, rates in zip(PODS, omega, strict=True):
        d_phi, d_theta = angle_rates(phi * pod.phi_shape, theta * pod.theta_shape, rates)
        expected += [pod.to_phi * d_phi, pod.to_theta * d_theta]
    assert_allclose(modal_rates(phi, theta, omega.ravel().tolist(), PODS), expected, rtol=1e-14)


def test_pod_that_is_silent_has_no_part() -> None:
    omega = np.ones((2, 3)).ravel().tolist()
    both = np.array(modal_rates(0.1, 0.2, omega, PODS))
    each = [np.array(modal_rates(0.1, 0.2, omega, [pod])) for pod in PODS]
    assert_allclose(sum(each), both, rtol=1e-14)
    assert modal_rates(0.1, 0.2, omega, []) == (0.0, 0.0)


def test_midpoint_rule_is_of_second_order() -> None:
    """Halving the step quarters the error against very small steps."""
    omega = np.array([[0.8, 0.5, -0.3], [1.0, -0.4, 0.6]])

    def flown(steps: int) -> np.ndarray:
        x = np.array([0.2, -0.1])
        for _ in range(steps):
            x, _ = midpoint(x, omega, 0.5 / steps, PODS)
        return x

    exact = flown(4096)
    coarse, fine = (np.abs(flown(steps) - exact).max() for steps in (8, 16))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_biases_are_taken_off_the_rates_and_stay() -> None:
    omega = np.random.default_rng(4).normal(size=(2, 3))
    bias = np.random.default_rng(5).normal(size=(2, 3))
    free, middle = midpoint(np.array([0.1, 0.2]), omega, 0.01, PODS)
    with_bias = np.array([0.1, 0.2, *bias.ravel()])
    after, after_middle = midpoint(with_bias, omega + bias, 0.01, PODS)
    assert_allclose(after[:2], free, atol=1e-15)
    assert_allclose(after_middle, middle, atol=1e-15)
    assert_allclose(after[2:], bias.ravel(), rtol=0, atol=0)
