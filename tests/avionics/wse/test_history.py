"""A filter that has lost the shape restarts instead of stopping the flight."""

import numpy as np
import pytest

from avionics.wse.adaptive_noise import AdaptiveNoise
from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.history import History
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates
from avionics.wse.state import Estimate, StateLayout
from avionics.wse.update import MarkerMeasurement, UpdateResult

MS = 1_000_000


class Broken:
    """An update that fails once, then leaves everything as it is."""

    def __init__(self, failure: str) -> None:
        self._failure = failure

    needs_motion = True

    def apply(self, estimate, noise, measurement, motion):
        failure, self._failure = self._failure, ""
        if failure == "singular":
            raise np.linalg.LinAlgError
        wild = {"wild": 1e6, "nan": np.nan, "": 0.0}[failure]
        moved = Estimate(estimate.x + wild, estimate.P)
        return UpdateResult(measurement.t_ns, moved, noise, np.zeros_like(measurement.found))


@pytest.mark.parametrize("failure", ["singular", "wild", "nan"])
def test_a_lost_filter_restarts(basis, failure: str) -> None:
    layout = StateLayout(basis, ("0", "1"), prior=np.ones(6), truncation=1e-3)
    process = Process(ModalRates(basis, np.array([0.6, 1.2]), np.ones(6)), layout, 1e-4)
    regime = Regime((True, True), np.zeros(3))

    def make_step(a_ns: int, b_ns: int, like: Regime) -> GyroStep:
        return GyroStep((b_ns - a_ns) * 1e-9, np.full((2, 3), 0.1), like)

    history = History(process, Broken(failure), make_step, 600 * MS)
    start = np.full(6, 0.05)
    history.start(0, Estimate(start, np.eye(6)), AdaptiveNoise(1.0))
    for i in range(1, 6):
        history.append(10 * i * MS, regime)
    seen = np.ones(2, dtype=bool)
    result = history.insert(MarkerMeasurement(25 * MS, np.zeros((2, 2)), np.ones(2), seen))
    assert result.lost
    assert not result.used.any()
    assert result.estimate.x == pytest.approx(start)
    assert np.isfinite(history.last.x).all()
    # The frame after is used as any other.
    again = history.insert(MarkerMeasurement(35 * MS, np.zeros((2, 2)), np.ones(2), seen))
    assert not again.lost
