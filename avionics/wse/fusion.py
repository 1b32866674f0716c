"""RG-WSE and CRG-WSE side by side: rates and measurements in, estimates out. Knows no records."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.adaptive_noise import AdaptiveNoise, UpdateRules
from avionics.wse.forecast import Forecast, at_ticks
from avionics.wse.gyro_rates import GyroInputs
from avionics.wse.gyro_step import GyroStep, Motion
from avionics.wse.history import History, Node
from avionics.wse.markers import MarkerModel
from avionics.wse.rg import GyroIntegrator
from avionics.wse.settings import FilterSettings
from avionics.wse.state import Estimate, StateLayout
from avionics.wse.update import MarkerMeasurement, MarkerUpdate, UpdateResult

Array = NDArray[Any]

# RG-WSE's start shape is fitted with this pixel noise, px: one mode leaves several unexplained.
PAPER_FIT_PX = 8.0
# Share of a new guess in the mean square error of the turns guessed ahead of the gyros.
TURN_ERROR_GAIN = 0.05


class WingFusion:
    """Both estimators of one wing.

    Parameters
    ----------
    settings : FilterSettings
        Bases, noises and rules, resolved.
    model : MarkerModel
        Pixels of the markers in the camera-aided filter's basis.
    paper_model : MarkerModel
        The same in RG-WSE's basis, for its start shape.
    """

    def __init__(
        self, settings: FilterSettings, model: MarkerModel, paper_model: MarkerModel
    ) -> None:
        self.settings = s = settings
        self._period_ns = s.step_ns
        self.inputs = GyroInputs(s.rates, s.pod_period_ns)
        self._process, self._paper_process = s.process(), s.paper_process()
        update = MarkerUpdate(model, s.layout, s.rules, s.prior, row_time=s.row_time)
        self._history = History(self._process, update, self.inputs.step, s.history_ns)
        self._paper_fit = MarkerUpdate(
            paper_model,
            StateLayout(paper_model.basis, (), prior=s.paper_prior),
            UpdateRules(gate=s.rules.gate, start_noise=PAPER_FIT_PX, adapt=False),
            s.paper_prior,
        )
        self._rg: GyroIntegrator | None = None
        self._start = Estimate(np.zeros(s.layout.size), s.layout.start_P)
        self._last_update: UpdateResult | None = None
        # Mean square error of the turn guessed ahead of the gyros by pod and axis, rad^2.
        self._turn_error = np.zeros((len(s.pods_s), 3))
        self._guesses: dict[int, tuple[int, Array, tuple[bool, ...]]] = {}
        self._turns: deque[tuple[int, Array]] = deque(maxlen=16)

    @property
    def has_begun(self) -> bool:
        """Whether the gyros have given the filter its first instant."""
        return self._rg is not None

    @property
    def known_ns(self) -> int:
        """Newest instant of the filter, ns."""
        return self._history.last.t_ns

    def advance(self, now_ns: int) -> None:
        """Run the filter over every step of the grid whose rates are known at ``now_ns``."""
        if self._rg is None:
            self._rg = self._begin(now_ns)
        if self._rg is None:
            return
        horizon = self.inputs.known_until(now_ns)
        t = self.known_ns
        while t + self._period_ns <= horizon:
            regime = self.inputs.regime(t, t + self._period_ns)
            step = self._history.append(t + self._period_ns, regime)
            t += self._period_ns
            self._rg.append(t, step)
            self._compare_guess(t, step)
        self.inputs.forget(self._history.oldest_ns - self._period_ns)

    def restart(self) -> None:
        """Forget the past: the next samples are a new start."""
        self.inputs = GyroInputs(self.settings.rates, self.settings.pod_period_ns)
        self._history.make_step = self.inputs.step
        self._rg = None
        self._guesses.clear()
        self._turns.clear()

    def _begin(self, now_ns: int) -> GyroIntegrator | None:
        first = self.inputs.first_known_ns(now_ns)
        if first is None:
            return None
        t = -(-first // self._period_ns) * self._period_ns
        self._history.start(t, self._start, self.settings.start_noise())
        keep = self.settings.history_ns // self._period_ns
        return GyroIntegrator(self._paper_process, t, keep=keep)

    def can_use(self, t_ns: int) -> bool | None:
        """Return whether a measurement can be used now; None if it is too old for ever."""
        if not self.has_begun or t_ns > self.known_ns:
            return False
        return True if self._history.covers(t_ns) else None

    def update(self, measurement: MarkerMeasurement) -> UpdateResult:
        """Fuse a measurement at its own time; return what was done and the estimate after it."""
        result = self._history.insert(measurement)
        if result.used.any():
            self._last_update = result
        self._start_rg(measurement, result)
        return result

    def _start_rg(self, measurement: MarkerMeasurement, result: UpdateResult) -> None:
        """Give RG-WSE its start shape: a least-squares fit to the first good frame."""
        rg, used = self._rg, result.used
        if rg is None or rg.is_started or used.sum() < min(2, len(used)):
            return
        n = len(self.settings.paper_prior)
        fit = self._paper_fit.apply(
            Estimate(np.zeros(n), np.diag(self.settings.paper_prior)),
            AdaptiveNoise(PAPER_FIT_PX**2),
            MarkerMeasurement(measurement.t_ns, measurement.pixel, measurement.sigma, used),
            Motion(np.zeros(n), np.zeros(n)),
        )
        if fit.used.any():
            rg.start(measurement.t_ns, fit.estimate)

    def estimate_at(self, t_ns: int) -> Estimate:
        """Return CRG-WSE at ``t_ns`` with what is known now; ahead of the gyros it extrapolates."""
        if not self.has_begun:
            return self._start
        node = self._history.at(t_ns)
        if t_ns <= node.t_ns:
            return self._drifted(node, node.x, node.step)
        if t_ns < self.known_ns:
            step = self.inputs.step(node.t_ns, t_ns, self._history.regime_after(node))
            return self._drifted(node, self._process.move(node.x, step)[0], step)
        step = self.inputs.ahead(node.t_ns, t_ns)
        x, P = self._drifted(node, self._process.move(node.x, step)[0], step)
        return Estimate(x, self._process.widen(P, step, self._turn_error))

    def _drifted(self, node: Node, x: Array, step: GyroStep | None) -> Estimate:
        """State ``x``, a step after a node, with the covariance that was last known drifted on."""
        known = self._history.known_before(node)
        assert known.P is not None
        if step is None or (known is node and step is node.step):
            return Estimate(x, known.P)
        dt = (node.t_ns - known.t_ns) * 1e-9 + (0.0 if step is node.step else step.dt)
        scale = node.noise.scale_of(step.live)
        return Estimate(x, self._process.drifted(known.P, dt, step, scale))

    def forecast(self, tick_ns: int) -> Forecast:
        """Return what is known when a tick is due, and remember the guess to learn from it."""
        last_update = self._last_update
        if self._rg is None:
            paper = self.settings.paper_layout
            nothing = Estimate(np.zeros(paper.size), paper.start_P)
            return Forecast(tick_ns, nothing, self._start, last_update)
        rg = self._rg.estimate
        if tick_ns <= self.known_ns:
            return Forecast(tick_ns, rg, self.estimate_at(tick_ns), last_update)
        last = self._history.last
        known = self._history.known_before(last)
        assert known.P is not None
        step = self.inputs.ahead(last.t_ns, tick_ns)
        self._guesses[tick_ns] = (last.t_ns, step.dt * step.rates, step.live)
        return Forecast(
            tick_ns,
            rg,
            Estimate(last.x, known.P),
            last_update,
            step,
            (tick_ns - known.t_ns) * 1e-9,
            last.noise.scale_of(step.live),
            self._turn_error,
        )

    def at_ticks(self, forecasts: Sequence[Forecast]) -> tuple[Estimate, Estimate]:
        """Return (RG-WSE, CRG-WSE) at the ticks of some forecasts, stacked."""
        return at_ticks(forecasts, self._process, self._paper_process)

    def _compare_guess(self, t_ns: int, step: GyroStep) -> None:
        """Compare the turn that was guessed up to ``t_ns`` with what the gyros measured since.

        Pod by pod and axis by axis, without the filter's state: how the rows' uncertainty grows
        ahead of the gyros does not depend on which frames have come.
        """
        self._turns.append((t_ns, step.dt * step.rates))
        guess = self._guesses.pop(t_ns, None)
        if guess is None:
            return
        since_ns, turned, live = guess
        if live != step.live:
            return
        truly = sum(turn for t, turn in self._turns if t > since_ns)
        error = self._turn_error
        self._turn_error = error + TURN_ERROR_GAIN * ((turned - truly) ** 2 - error)
