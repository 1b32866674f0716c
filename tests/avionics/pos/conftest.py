"""Short flights and nodes shared by the tests; SI and radians."""

import numpy as np
import pytest

from avionics.pos.flexure import markov_flexure
from avionics.pos.motion import Leg, Start, half_step_times, motion_along_legs
from avionics.pos.simulate import Grade, Node, Reference
from avionics.pos.trajectory import Trajectory, trajectory_from_motion

DT = 0.01
DEG = np.pi / 180.0
DEG_H = DEG / 3600.0
MICRO_G = 9.80665e-6
START = Start(40.0 * DEG, 116.0 * DEG, 500.0, 40.0 * DEG, 100.0)
LEGS = (
    Leg(15.0),
    Leg(25.0, turn=60.0 * DEG, speed_change=30.0),
    Leg(20.0, turn=-40.0 * DEG, climb=80.0),
    Leg(15.0),
)
SILENT = Grade(0.0, 0.0, 0.0, 0.0)


def fly(legs: tuple[Leg, ...] = LEGS, start: Start = START, *, banked: bool = True) -> Trajectory:
    times = half_step_times(sum(leg.duration for leg in legs), DT)
    return trajectory_from_motion(motion_along_legs(times, legs, start, banked=banked), start)


def make_node(**changes: object) -> Node:
    values: dict[str, object] = {
        "rho": np.full(3, 0.5 * DEG),
        "r0": np.array([5.0, 0.1, 0.1]),
        "flexure": markov_flexure(
            np.array([2.0, 5.0, 2.0]), np.sqrt(np.array([0.01, 0.15, 0.01])) * DEG
        ),
        "master": Grade(0.01 * DEG_H, 0.01 * DEG_H, 50 * MICRO_G, 50 * MICRO_G),
        "slave": Grade(0.1 * DEG_H, 0.1 * DEG_H, 50 * MICRO_G, 50 * MICRO_G),
        "reference": Reference(0.02 * DEG, 0.005 * DEG, 0.005 * DEG, 0.03),
    }
    return Node(**{**values, **changes})  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def trajectory() -> Trajectory:
    return fly()


@pytest.fixture(scope="session")
def node() -> Node:
    return make_node()
