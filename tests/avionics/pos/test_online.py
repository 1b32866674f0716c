"""The bank that flies against the filter of the studies."""

from dataclasses import replace

import numpy as np
import pytest

from avionics.pos.difference_filter import DifferenceOptions, difference_filter
from avionics.pos.online import GsBank, GyroNoise
from avionics.pos.simulate import simulate
from avionics.pos.trajectory import Trajectory
from tests.avionics.pos.conftest import DEG, DT, make_node

pytestmark = pytest.mark.slow


def test_the_bank_equals_the_compiled_filter_for_every_pod(trajectory: Trajectory) -> None:
    node = make_node()
    steps = 2500
    runs = [simulate(trajectory, node, np.random.default_rng(seed))[1] for seed in (1, 2)]
    # One master for both: its noise is that of the first run.
    runs[1] = replace(runs[1], rate_m=runs[0].rate_m)
    gyros = GyroNoise(
        node.master.gyro_noise, node.slave.gyro_noise, node.master.gyro_bias, node.slave.gyro_bias
    )
    bank = GsBank(2, DT, node.flexure, gyros, 0.5 * DEG)
    heard = np.ones(2, dtype=bool)
    for k in range(1, steps + 1):
        bank.step(runs[0].rate_m[k], np.stack([run.rate_s[k] for run in runs]), heard)
    for pod, run in enumerate(runs):
        found = difference_filter(run, node, DT, DifferenceOptions(), stride=1).filtered
        np.testing.assert_allclose(bank.angle[pod], found.system_angle[steps], atol=1e-9)
        sigma = np.sqrt(np.diag(bank.angle_covariance[pod]))
        np.testing.assert_allclose(sigma, found.system_sigma[steps], rtol=1e-6)


def test_a_silent_pod_grows_uncertain_and_does_not_disturb_the_other(
    trajectory: Trajectory,
) -> None:
    node = make_node()
    _, run = simulate(trajectory, node, np.random.default_rng(1))
    gyros = GyroNoise(1e-4, 1e-4, 0.0, 1e-3)
    both = GsBank(2, DT, node.flexure, gyros, 0.5 * DEG)
    alone = GsBank(1, DT, node.flexure, gyros, 0.5 * DEG)
    for k in range(1, 1500):
        rate = np.stack([run.rate_s[k]] * 2)
        both.step(run.rate_m[k], rate, np.array([True, k < 1000]))
        alone.step(run.rate_m[k], rate[:1], np.array([True]))
    np.testing.assert_allclose(both.x[0], alone.x[0], atol=1e-12)
    sigma = np.sqrt(np.einsum("mii->mi", both.angle_covariance))
    assert np.all(sigma[1] > sigma[0])
