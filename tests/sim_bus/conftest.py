import numpy as np
import pytest

from avionics.config import Config
from avionics.config.load import default_config_text, parse_config_text


class Wave:
    """A motion that is known: rate about x is a sine, gravity on z, an earth field."""

    def __init__(self, peak_dps: float = 100.0, hz: float = 1.0, still_after_ns: int = 1 << 62):
        self.peak, self.hz, self.still_after_ns = np.radians(peak_dps), hz, still_after_ns

    def sense(self, t_ns):
        rate, force = np.zeros((len(t_ns), 3)), np.zeros((len(t_ns), 3))
        moving = t_ns < self.still_after_ns
        rate[:, 0] = np.where(moving, self.peak * np.sin(2 * np.pi * self.hz * t_ns * 1e-9), 0)
        force[:, 2] = -9.80665
        return rate, force, np.full((len(t_ns), 3), 2e-5)

    def attitude(self, t_ns):
        return np.eye(3)


@pytest.fixture
def wave() -> Wave:
    return Wave()


@pytest.fixture
def waves() -> type[Wave]:
    """Makes waves of other heights."""
    return Wave


@pytest.fixture(scope="session")
def config() -> Config:
    return parse_config_text(default_config_text(), (), origin="packaged")
