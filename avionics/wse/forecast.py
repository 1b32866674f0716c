"""Both estimators' states carried ahead of the gyros, to the ticks at which rows are due."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from avionics.wse.gyro_step import GyroStep, stacked
from avionics.wse.process import Process
from avionics.wse.state import Estimate
from avionics.wse.update import UpdateResult

Array = NDArray[Any]


class Forecast(NamedTuple):
    """What is known when a tick is due, and the step ahead of the gyros that leads to it.

    Attributes
    ----------
    t_ns : int
        The tick, ns.
    rg, crg : Estimate
        Newest estimates of RG-WSE and CRG-WSE; the covariance may be older than the state.
    update : UpdateResult or None
        The last update that used markers.
    step : GyroStep or None
        From the states to the tick; None where they are the tick's already.
    since_s : float
        From the instant of CRG-WSE's covariance to the tick, s.
    scale : float
        Process-noise scale.
    turn_error : ndarray, shape (M, 3)
        Mean square error of the turns guessed ahead of the gyros so far, rad^2.
    """

    t_ns: int
    rg: Estimate
    crg: Estimate
    update: UpdateResult | None
    step: GyroStep | None = None
    since_s: float = 0.0
    scale: float = 1.0
    turn_error: Array | None = None


def at_ticks(
    forecasts: Sequence[Forecast], process: Process, paper_process: Process
) -> tuple[Estimate, Estimate]:
    """Return (RG-WSE, CRG-WSE) at the ticks of some forecasts, stacked; one batched call for all.

    Parameters
    ----------
    forecasts : sequence of Forecast
        At least one.
    process, paper_process : Process
        Time updates of CRG-WSE and of RG-WSE.
    """
    rg, crg = stack([f.rg for f in forecasts]), stack([f.crg for f in forecasts])
    alike: dict[object, list[int]] = {}
    for i, forecast in enumerate(forecasts):
        if forecast.step is not None:
            alike.setdefault(forecast.step.kind, []).append(i)
    for at in alike.values():
        some = [forecasts[i] for i in at]
        step = stacked([f.step for f in some if f.step is not None])
        rg.x[at] = paper_process.move(rg.x[at], step)[0]
        crg.x[at] = process.move(crg.x[at], step)[0]
        since_s, scale = np.array([f.since_s for f in some]), np.array([f.scale for f in some])
        drifted = process.drifted(crg.P[at], since_s, step, scale)
        crg.P[at] = process.widen(drifted, step, np.array([f.turn_error for f in some]))
    return rg, crg


def stack(estimates: Sequence[Estimate]) -> Estimate:
    """Return some estimates as one, its arrays with the estimates first."""
    return Estimate(np.array([e.x for e in estimates]), np.array([e.P for e in estimates]))
