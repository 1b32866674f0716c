"""Bases and amplitudes that every family takes part in."""

import numpy as np
import pytest

from avionics.wse.modes import ModeBasis


@pytest.fixture
def basis() -> ModeBasis:
    return ModeBasis("quarter-sine", 1.5, 3, 2, 1)


@pytest.fixture
def q() -> np.ndarray:
    return np.array([0.6, 0.1, -0.05, 0.2, -0.06, 0.08])
