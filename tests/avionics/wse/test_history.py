"""A filter that has lost itself starts anew instead of stopping the flight."""

import numpy as np
import pytest

from avionics.wse.adaptive_noise import NO_VERDICT, Sighting, Trust
from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.history import History
from avionics.wse.process import Process, ProcessNoise
from avionics.wse.rates import ModalRates

MS = 1_000_000


class Broken:
    """An update that fails once, then leaves everything as it is."""

    def __init__(self, failure: str) -> None:
        self._failure = failure

    needs_motion = True

    def apply(self, x, P, trust, sighting, motion):
        failure, self._failure = self._failure, ""
        if failure == "singular":
            raise np.linalg.LinAlgError
        wild = {"wild": 1e6, "nan": np.nan, "": 0.0}[failure]
        return x + wild, P, trust, NO_VERDICT


@pytest.mark.parametrize("failure", ["singular", "wild", "nan"])
def test_a_lost_filter_starts_anew(basis, failure: str) -> None:
    process = Process(
        ModalRates(basis, np.array([0.6, 1.2]), np.ones(6)),
        ProcessNoise(1e-4, 1e-3, 0.0),
        has_bias=False,
    )
    regime = Regime((True, True), np.zeros(3))

    def make_step(a_ns: int, b_ns: int, like: Regime) -> GyroStep:
        return GyroStep((b_ns - a_ns) * 1e-9, np.full((2, 3), 0.1), like)

    history = History(process, Broken(failure), make_step, 600 * MS)
    start = np.full(6, 0.05)
    history.begin(0, start, np.eye(6), Trust(1.0))
    for i in range(1, 6):
        history.append(10 * i * MS, regime)
    sighting = Sighting(25 * MS, np.zeros((2, 2)), np.ones(2), np.ones(2, dtype=bool))
    node = history.insert(sighting)
    assert node.verdict is not None
    assert node.verdict.lost
    assert node.x == pytest.approx(start)
    assert np.isfinite(history.last.x).all()
    # The frame after is taken as any other.
    again = history.insert(Sighting(35 * MS, sighting.pixel, sighting.sigma, sighting.found))
    assert again.verdict is not None
    assert not again.verdict.lost
