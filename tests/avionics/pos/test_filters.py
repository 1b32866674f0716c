"""Whole filters on short flights: noise-free truth, the plain twin, honest covariance, bounds."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from avionics.pos.bound import difference_bound
from avionics.pos.bound_imu import imu_bound
from avionics.pos.compiled import IS_COMPILED
from avionics.pos.difference_filter import DifferenceOptions, difference_filter
from avionics.pos.imu_filter import ImuOptions, imu_filter
from avionics.pos.methods import Method, covariance_analysis, estimate
from avionics.pos.metrics import Segment, statistics
from avionics.pos.motion import Leg, Start
from avionics.pos.simulate import Reference, simulate
from avionics.pos.trajectory import Trajectory
from tests.avionics.pos.conftest import DEG, DT, SILENT, START, fly, make_node
from tests.avionics.pos.plain import plain_gs

pytestmark = pytest.mark.slow

ARCMIN = DEG / 60.0
SILENT_REFERENCE = Reference(0.0, 0.0, 0.0, 0.0)
END = (Segment("end", 60.0, 75.0),)
METHODS = {
    "imu": Method("imu"),
    "gs": Method("gs"),
    "as": Method("as", nonlinear=False, arm_model=True),
    "ga": Method("ga", arm_model=True),
}


def rmse_arcmin(
    method: Method, trajectory: Trajectory, seed: int = 1, **node: object
) -> np.ndarray:
    """Run on error-free sensors while the filter believes in the ordinary noises."""
    silent = make_node(master=SILENT, slave=SILENT, reference=SILENT_REFERENCE, **node)
    truth, measured = simulate(trajectory, silent, np.random.default_rng(seed))
    found = estimate(method, measured, make_node(**node), trajectory).filtered
    return statistics(found, truth, DT, END).rmse[0, 0] / ARCMIN


def test_noise_free_imu_finds_the_angle(trajectory: Trajectory) -> None:
    """What is left is the filter's lag behind the flexure, far below its own sigma."""
    assert np.all(rmse_arcmin(METHODS["imu"], trajectory) < [0.09, 0.09, 0.25])


def test_noise_free_ga_finds_the_angle(trajectory: Trajectory) -> None:
    assert np.all(rmse_arcmin(METHODS["ga"], trajectory) < [0.02, 0.02, 0.1])


@pytest.mark.parametrize("axis", range(3))
def test_a_misaligned_axis_is_found_on_that_axis_with_its_sign(
    trajectory: Trajectory, axis: int
) -> None:
    """Jacobian signs: one axis misaligned, nothing flexes, no noise: rho comes out as it is."""
    rho = np.zeros(3)
    rho[axis] = 0.4 * DEG
    node = make_node(rho=rho, master=SILENT, slave=SILENT, reference=SILENT_REFERENCE)
    stiff = make_node(flexure=type(node.flexure)(np.ones(3), np.ones(3), np.full(3, 1e-9)))
    still = make_node(
        rho=rho, master=SILENT, slave=SILENT, reference=SILENT_REFERENCE, flexure=stiff.flexure
    )
    _, measured = simulate(trajectory, still, np.random.default_rng(0))
    for name, method in METHODS.items():
        if name == "as" and axis == 2:
            continue  # the vertical axis is not observed by accelerometers in level flight
        found = estimate(method, measured, stiff, trajectory).filtered
        error = found.system_angle[-1] - rho
        checked = [0, 1] if name == "as" else [0, 1, 2]
        assert np.abs(error[checked]).max() < 0.6 * ARCMIN, (name, error / ARCMIN)


def test_compiled_gs_equals_the_plain_one(trajectory: Trajectory) -> None:
    node = make_node()
    _, measured = simulate(trajectory, node, np.random.default_rng(2))
    steps = 2500
    u, covariance = plain_gs(measured, node, DT, steps)
    found = difference_filter(
        measured, node, DT, DifferenceOptions(nonlinear=False), stride=1
    ).filtered
    np.testing.assert_allclose(found.system_angle[1 : steps + 1], u, atol=1e-9)
    sigma = np.sqrt(np.einsum("kii->ki", covariance))
    np.testing.assert_allclose(found.system_sigma[1 : steps + 1], sigma, rtol=1e-6)


def run_all(folder: Path) -> Path:
    """Run every method and smoother over a fifth of a second and keep what they say."""
    flight, node, out = fly((Leg(0.2),)), make_node(), {}
    _, measured = simulate(flight, node, np.random.default_rng(3))
    for name, method in METHODS.items():
        made = estimate(method, measured, node, flight, smooth=True, stride=1)
        assert made.smoothed is not None
        for kind, found in (("filtered", made.filtered), ("smoothed", made.smoothed)):
            out[f"{name} {kind}"] = np.hstack([found.system_angle, found.system_sigma])
    path = folder / f"{'compiled' if IS_COMPILED else 'plain'}{len(list(folder.iterdir()))}.npz"
    np.savez(path, **out)
    return path


def test_plain_python_gives_what_the_compiler_gives(tmp_path: Path) -> None:
    """The same source run uncompiled: the twin of every loop, smoothers included."""
    if not IS_COMPILED:
        pytest.skip("numba is not installed: there is one way only")
    root = str(Path(__file__).resolve().parents[3])
    script = (
        f"import sys; sys.path.insert(0, {root!r}); from pathlib import Path; "
        f"from tests.avionics.pos.test_filters import run_all; run_all(Path({str(tmp_path)!r}))"
    )
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", script], check=True, env=env, cwd=root)
    (plain_path,) = tmp_path.iterdir()
    with np.load(plain_path) as plain, np.load(run_all(tmp_path)) as made:
        assert set(made.files) == set(plain.files)
        for name in made.files:
            np.testing.assert_allclose(made[name], plain[name], rtol=1e-7, atol=1e-13, err_msg=name)


@pytest.mark.parametrize("name", ["imu", "gs", "ga"])
def test_errors_are_as_large_as_the_filter_says(trajectory: Trajectory, name: str) -> None:
    """Eight flights: normalised error of u at the end, chi-squared with 24 degrees of freedom."""
    nees, smoothed = [], []
    for seed in range(8):
        node = make_node()
        truth, measured = simulate(trajectory, node, np.random.default_rng(100 + seed))
        made = estimate(METHODS[name], measured, node, trajectory, stride=100, smooth=True)
        for found, bag in ((made.filtered, nees), (made.smoothed, smoothed)):
            assert found is not None
            k = 60
            error = found.system_angle[k] - truth.system_angle[found.index[k]]
            bag.append(error @ np.linalg.solve(found.system_covariance[k], error))
    for bag in (nees, smoothed):
        assert 7.0 < sum(bag) < 53.0  # chi2(24): 99.9 % on either side


@pytest.mark.parametrize("name", ["imu", "gs", "ga"])
def test_predicted_sigma_is_the_bound_computed_apart(trajectory: Trajectory, name: str) -> None:
    node = make_node()
    truth, measured = simulate(trajectory, node, np.random.default_rng(7))
    found = estimate(METHODS[name], measured, node, trajectory, stride=100).filtered
    if name == "imu":
        bound = imu_bound(trajectory, node, truth, hold=20)
    else:
        bound = difference_bound(trajectory, node, truth, gyros=True, forces=name == "ga")
    late = np.arange(35, 75)
    sigma = found.system_sigma[late]
    nearest = np.searchsorted(bound.t, late * 1.0 - 1e-9)
    ratio = sigma / bound.sigma[np.minimum(nearest, len(bound.t) - 1)]
    assert np.all(np.abs(ratio.mean(axis=0) - 1.0) < 0.06), ratio.mean(axis=0)


def test_smoothing_never_makes_an_estimate_less_certain(trajectory: Trajectory) -> None:
    for method in METHODS.values():
        made = covariance_analysis(method, make_node(), trajectory, stride=50)
        assert made.smoothed is not None
        before, after = made.filtered.system_sigma, made.smoothed.system_sigma
        assert np.all(after <= before * (1 + 1e-6))
        np.testing.assert_allclose(after[-1], before[-1], rtol=1e-9)


def test_updating_less_often_is_less_certain(trajectory: Trajectory) -> None:
    node = make_node()
    _, measured = simulate(trajectory, node, np.random.default_rng(1))
    often, seldom = (
        imu_filter(measured, node, START, DT, ImuOptions(every=every)).filtered.system_sigma[-1]
        for every in (1, 5)
    )
    assert np.all(seldom > 1.3 * often)


def test_instant_samples_miss_the_path_by_the_stated_noise(trajectory: Trajectory) -> None:
    """The trapezoid of theta_dot misses the path by Q T^3 / 12 a step, Q T^2 / 12 a second."""
    node = make_node(gyro="instant")
    truth, measured = simulate(trajectory, node, np.random.default_rng(4))
    steps = np.diff(truth.theta, axis=0)
    missed = steps - 0.5 * DT * (truth.theta_dot[1:] + truth.theta_dot[:-1])
    np.testing.assert_allclose(missed.var(axis=0), node.flexure.psd * DT**3 / 12.0, rtol=0.05)
    plain, covering = (
        imu_filter(
            measured, node, START, DT, ImuOptions(sampling="instant", sampling_noise=factor)
        ).filtered
        for factor in (0.0, 1.0)
    )
    assert np.all(covering.system_sigma[-1] > 1.05 * plain.system_sigma[-1])


def test_combinations_that_cannot_work_are_refused(trajectory: Trajectory) -> None:
    node = make_node()
    _, measured = simulate(trajectory, node, np.random.default_rng(1))
    with pytest.raises(ValueError, match="wants gyros"):
        difference_filter(measured, node, DT, DifferenceOptions(gyros=False))
    with pytest.raises(ValueError, match="nonlinear = False"):
        difference_filter(
            measured, node, DT, DifferenceOptions(gyros=False, forces=True, arm_model=True)
        )
    found = estimate(METHODS["gs"], measured, node, trajectory).filtered
    truth, _ = simulate(trajectory, node, np.random.default_rng(1))
    with pytest.raises(ValueError, match="holds no estimate"):
        statistics(found, truth, DT, (Segment("late", 80.0, 90.0),))


def test_a_turn_makes_the_gyros_see_the_angle() -> None:
    straight = covariance_analysis(METHODS["gs"], make_node(), fly((Leg(60.0),)), stride=100)
    turning = covariance_analysis(
        METHODS["gs"], make_node(), fly((Leg(60.0, turn=120.0 * DEG),)), stride=100
    )
    assert np.all(turning.filtered.system_sigma[-1] < 0.7 * straight.filtered.system_sigma[-1])


def test_start_at_rest_and_at_any_heading_works() -> None:
    start = Start(-60.0 * DEG, -179.9 * DEG, 20.0, 179.0 * DEG, 0.0)
    flight = fly((Leg(10.0), Leg(20.0, speed_change=20.0), Leg(20.0, turn=90.0 * DEG)), start)
    node = make_node()
    truth, measured = simulate(flight, node, np.random.default_rng(1))
    found = estimate(METHODS["imu"], measured, node, flight).filtered
    error = found.system_angle[-1] - truth.system_angle[-1]
    assert np.all(np.abs(error) < 5.0 * found.system_sigma[-1])
