"""A chip that turns."""

import numpy as np
import pytest

from drivers.clock import SteadyClock
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.sensing import ImuGrade

# Noise and no other errors: without it every reading repeats the last and looks frozen.
NOISY = ImuGrade(
    gyro_offset_dps=0.0, gyro_scale=0.0, misalignment_deg=0.0, gyro_walk_dps_sqrts=0.0,
    gyro_offset_dps_per_k=0.0,
)  # fmt: skip
RATE_RAD_S = np.array([0.5, -0.3, 0.8])


class Turning:
    """A constant rate, gravity along z."""

    def sense(self, t_ns):
        one = np.ones((len(t_ns), 1))
        return one * RATE_RAD_S, one * np.array([0, 0, 9.81]), one * np.array([2e-5, 0, 4e-5])

    def attitude(self, t_ns):
        return np.eye(3)


@pytest.fixture
def rate_rad_s() -> np.ndarray:
    """What ``chip`` feels."""
    return RATE_RAD_S


@pytest.fixture
def make_chip():
    """Return a function that makes a chip that has booted."""

    def make(seed: int = 1) -> SimBno055:
        return SimBno055(
            Turning(), np.random.default_rng(seed), grade=NOISY,
            power_on_ns=SteadyClock().now_ns() - 1_000_000_000,
        )  # fmt: skip

    return make
