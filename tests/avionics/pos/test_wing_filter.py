"""Guo and Zhu's 15 states on a short U turn."""

from dataclasses import replace

import numpy as np
import pytest

from avionics.pos.beam import Beam, modes
from avionics.pos.flexure import Flexure
from avionics.pos.methods import Method, estimate
from avionics.pos.motion import Leg, Start
from avionics.pos.simulate import Grade, Node, Reference, simulate
from avionics.pos.trajectory import Trajectory
from avionics.pos.wing_filter import STATES
from tests.avionics.pos.conftest import DEG, DEG_H, MICRO_G, SILENT, fly, make_node

pytestmark = pytest.mark.slow

ARCMIN = DEG / 60.0
LEGS = (Leg(20.0, speed_change=100.0), Leg(20.0), Leg(60.0, turn=180.0 * DEG), Leg(20.0))


@pytest.fixture(scope="module")
def flight() -> Trajectory:
    return fly(LEGS, Start(40 * DEG, 116 * DEG, 3000.0, 45 * DEG, 0.0))


def wing_node() -> Node:
    frequency = float(modes(Beam(5.0, 0.5, 0.06), 64, 1)[0][0])
    law = Flexure(
        np.array([1.0, frequency, 1.0]), np.array([1.0, 0.03, 1.0]), np.array([0, 0.2 * DEG, 0])
    )
    return make_node(
        r0=np.zeros(3),
        arm="rigid",
        flexure=law,
        master=SILENT,
        slave=Grade(0.02 * DEG_H, 0.01 * DEG_H, 100 * MICRO_G, 50 * MICRO_G),
        reference=Reference(0.01 * DEG, 0.005 * DEG, 0.005 * DEG, 0.02),
    )


def test_the_states_are_guos_fifteen() -> None:
    assert len(STATES) == 15
    assert list(STATES[-2:]) == [19, 22]  # theta_y and its rate


def test_misalignment_and_bending_are_found_after_the_turn(flight: Trajectory) -> None:
    node = wing_node()
    truth, measured = simulate(flight, node, np.random.default_rng(1))
    made = estimate(Method("wing"), measured, node, flight, smooth=True)
    assert made.smoothed is not None
    late = made.filtered.index > 10_500
    for found, scale in ((made.filtered, 1.0), (made.smoothed, 0.75)):
        rho = np.abs(found.rho[late] - truth.rho).max(axis=0) / ARCMIN
        assert np.all(rho < [0.05, 0.4, 0.1])
        theta = (found.theta[:, 1] - truth.theta[found.index, 1])[late]
        assert theta.std() / ARCMIN < 0.32 * scale
        assert not found.theta[:, [0, 2]].any()


def test_linear_filter_is_off_by_half_the_square_of_the_misalignment(flight: Trajectory) -> None:
    """0.5 deg about each axis: (8.7 mrad)^2 / 2 = 0.13 arcmin on every axis, noise-free.

    The bank of the turn and what the biases make of it move it by up to a fifth.
    """
    node = wing_node()
    stiff = replace(node, flexure=replace(node.flexure, sigma=np.array([0.0, 1e-7, 0.0])))
    silent = replace(stiff, slave=SILENT, reference=Reference(0.0, 0.0, 0.0, 0.0))
    _, measured = simulate(flight, silent, np.random.default_rng(1))
    linear = estimate(Method("wing", nonlinear=False), measured, stiff, flight).filtered
    exact = estimate(Method("wing"), measured, stiff, flight).filtered
    offset = np.abs(linear.system_angle[-1] - silent.rho) / ARCMIN
    np.testing.assert_allclose(offset, (0.5 * DEG) ** 2 / 2.0 / ARCMIN, rtol=0.25)
    assert np.abs(exact.system_angle[-1] - silent.rho).max() / ARCMIN < 0.01


def test_markov_filter_knows_less_of_the_same_bending(flight: Trajectory) -> None:
    node = wing_node()
    truth, measured = simulate(flight, node, np.random.default_rng(2))
    errors = []
    for damping in (None, 1.0):
        found = estimate(Method("wing", damping=damping), measured, node, flight).filtered
        late = found.index > 10_500
        errors.append((found.theta[:, 1] - truth.theta[found.index, 1])[late].std())
    assert errors[0] < errors[1]
