"""Covariance matching: which noise an innovation moves, and by how much."""

from dataclasses import replace

import numpy as np
import pytest

from avionics.wse.adaptive_noise import AdaptiveNoise, UpdateRules, matched

MARKERS = 6
LIVE = (True, True)


def jacobian() -> np.ndarray:
    """Six markers whose rows bending moves by 100 to 350 px/rad; states: amplitude, its rate."""
    H = np.zeros((MARKERS, 2, 2))
    H[:, 1, 0] = 100.0 + 50.0 * np.arange(MARKERS)
    return H


def after(y: np.ndarray, rules: UpdateRules, rate_sigma: float) -> AdaptiveNoise:
    return matched(
        AdaptiveNoise(1.0, is_started=True),
        rules,
        y,
        jacobian(),
        np.diag([1e-8, rate_sigma**2]),
        variance=np.full(MARKERS, 0.01),
        prior=np.array([0.07]),
        unobserved=slice(1, 2),
        live=LIVE,
    )


def test_what_no_shape_explains_is_pixel_noise() -> None:
    y = np.zeros((MARKERS, 2))
    y[:, 0] = [3.0, -3.0, 3.0, -3.0, 3.0, -3.0]
    found = after(y, UpdateRules(), rate_sigma=0.5)
    # 54 px^2 over the eleven directions that bending leaves, averaged with the one of before.
    assert found.pixel_variance == pytest.approx(1.0 + (54.0 / 11 - 0.01 - 1.0) / 3)


def test_an_innovation_larger_than_expected_raises_the_process_noise() -> None:
    bent = jacobian()[:, :, 0] * 0.05
    assert after(bent, UpdateRules(), rate_sigma=0.5).scale > AdaptiveNoise(1.0).scale
    assert after(0.0 * bent, UpdateRules(), rate_sigma=0.5).scale < AdaptiveNoise(1.0).scale
    # A wing whose rates are all observed shows nothing of the process noise.
    assert after(bent, UpdateRules(), rate_sigma=0.0).scale == AdaptiveNoise(1.0).scale


def test_an_unobserved_rate_shows_over_the_time_between_frames() -> None:
    bent = jacobian()[:, :, 0] * 0.05
    slow, fast = UpdateRules(frame_s=0.033), UpdateRules(frame_s=0.008)

    def exponent(rules: UpdateRules) -> float:
        return float(np.log(after(bent, rules, rate_sigma=0.5).scale / AdaptiveNoise(1.0).scale))

    def share(frame_s: float) -> float:
        moved = (frame_s * 0.5) ** 2 * float((jacobian()[:, 1, 0] ** 2).sum())
        return moved / (moved + 1.01)

    assert exponent(fast) / exponent(slow) == pytest.approx(share(0.008) / share(0.033))


def test_scales_of_all_pods_and_of_some_are_apart() -> None:
    noise = AdaptiveNoise(1.0).with_scale((True, False), 3.0)
    assert noise.scale_of((True, False)) == noise.scale_of(()) == 3.0
    assert noise.scale_of(LIVE) == AdaptiveNoise(1.0).scale
    assert replace(noise, scale=2.0).scale_of(LIVE) == 2.0
