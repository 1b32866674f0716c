"""RG-WSE and CRG-WSE side by side: rates and sightings in, states out. Pure; knows no records."""

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.adaptive_noise import Sighting, Trust, UpdateRules, Verdict
from avionics.wse.forecast import Belief, Extrapolation, Outlook
from avionics.wse.gyro_inputs import GyroInputs
from avionics.wse.gyro_step import GyroStep
from avionics.wse.history import History, Node
from avionics.wse.markers import MarkerModel
from avionics.wse.motion import Motion
from avionics.wse.rg import StandaloneEstimate
from avionics.wse.settings import FilterSettings
from avionics.wse.update import MarkerUpdate

Array = NDArray[Any]


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
        self.settings = settings
        s = settings
        self._period_ns = s.step_ns
        self.inputs = GyroInputs(s.rates, s.pod_period_ns)
        self._process = s.process()
        update = MarkerUpdate(
            model,
            self._process.size,
            s.rules,
            s.prior,
            offset_index=self._process.offset,
            unseen=self._process.unseen,
            row_time=s.row_time,
        )
        self._history = History(self._process, update, self.inputs.step, s.history_ns)
        self._paper_process = s.paper_process()
        self._extrapolation = Extrapolation(s.rates, self._process, self._paper_process)
        self._paper_fit = MarkerUpdate(
            paper_model,
            2,
            UpdateRules(gate=s.rules.gate, start_noise=8.0, adapt=False),
            s.paper_prior,
        )
        self._standalone: StandaloneEstimate | None = None
        self._start = Belief(np.zeros(self._process.size), s.start_P(self._process))
        # Mean square error of the turn guessed ahead of the gyros by pod and axis, rad^2.
        self._guess_error = np.zeros((len(s.pods_s), 3))
        self._guesses: dict[int, tuple[int, Array, tuple[bool, ...]]] = {}
        self._turns: deque[tuple[int, Array]] = deque(maxlen=16)

    @property
    def has_begun(self) -> bool:
        """Whether the gyros have given the filter its first instant."""
        return self._standalone is not None

    @property
    def known_ns(self) -> int:
        """Newest instant of the filter, ns."""
        return self._history.last.t_ns

    def commit(self, now_ns: int) -> None:
        """Run the filter over every step of the grid that is known at ``now_ns``."""
        if self._standalone is None and not self._begin(now_ns):
            return
        assert self._standalone is not None
        horizon = self.inputs.known_until(now_ns)
        t = self.known_ns
        while t + self._period_ns <= horizon:
            regime = self.inputs.regime(t, t + self._period_ns)
            step = self._history.append(t + self._period_ns, regime)
            t += self._period_ns
            self._standalone.append(t, step)
            self._learn(t, step)
        self.inputs.forget(self._history.oldest_ns - self._period_ns)

    def begin_anew(self) -> None:
        """Forget everything: the next samples are a new start."""
        self.inputs = GyroInputs(self.settings.rates, self.settings.pod_period_ns)
        self._history.make_step = self.inputs.step
        self._standalone = None
        self._guesses.clear()
        self._turns.clear()

    def _begin(self, now_ns: int) -> bool:
        first = self.inputs.first_known_ns(now_ns)
        if first is None:
            return False
        t = -(-first // self._period_ns) * self._period_ns
        self._history.begin(t, self._start.x, self._start.P, self.settings.start_trust())
        self._standalone = StandaloneEstimate(
            self._paper_process,
            np.zeros(2),
            self.settings.paper_start_P(self._paper_process.size),
            t,
            keep=self.settings.history_ns // self._period_ns,
        )
        return True

    def can_take(self, t_ns: int) -> bool | None:
        """Return whether a sighting fits now; None if it is too old for ever."""
        if not self.has_begun or t_ns > self.known_ns:
            return False
        return True if self._history.covers(t_ns) else None

    def take(self, sighting: Sighting) -> tuple[Belief, Verdict]:
        """Fuse a sighting at its own time; return the belief of that time after it."""
        node = self._history.insert(sighting)
        assert node.verdict is not None
        self._start_standalone(sighting, node.verdict)
        assert node.P is not None
        return Belief(node.x, node.P), node.verdict

    def _start_standalone(self, sighting: Sighting, verdict: Verdict) -> None:
        """Give RG-WSE its start shape: a least-squares fit to the first good frame."""
        rg = self._standalone
        if rg is None or rg.is_started or verdict.used.sum() < min(2, len(verdict.used)):
            return
        s = self.settings
        good = Sighting(sighting.t_ns, sighting.pixel, sighting.sigma, verdict.used)
        P = np.diag(s.paper_prior)
        fit = self._paper_fit.apply(
            np.zeros(2), P, Trust(64.0), good, Motion(np.zeros(2), np.zeros(2))
        )
        if fit[3].used.any():
            rg.start(sighting.t_ns, fit[0], fit[1])

    def camera_aided(self, t_ns: int) -> Belief:
        """Return CRG-WSE at ``t_ns`` with what is known now; ahead of the gyros it extrapolates."""
        if not self.has_begun:
            return self._start
        node = self._history.at(t_ns)
        if t_ns <= node.t_ns:
            return self._drifted(node, node.x, node.step)
        if t_ns < self.known_ns:
            step = self.inputs.step(node.t_ns, t_ns, self._history.regime_after(node))
            return self._drifted(node, self._process.move(node.x, step)[0], step)
        return self._ahead(node, self.inputs.ahead(node.t_ns, t_ns))

    def _drifted(self, node: Node, x: Array, step: GyroStep | None) -> Belief:
        """State ``x``, a step after a node, with the covariance that was last known drifted on."""
        settled = self._history.settled_before(node)
        assert settled.P is not None
        if step is None or (settled is node and step is node.step):
            return Belief(x, settled.P)
        dt = (node.t_ns - settled.t_ns) * 1e-9 + (0.0 if step is node.step else step.dt)
        scale = node.trust.scale(step.live)
        return Belief(x, self._process.drifted(settled.P, dt, step, scale))

    def _ahead(self, node: Node, step: GyroStep) -> Belief:
        belief = self._drifted(node, self._process.move(node.x, step)[0], step)
        return Belief(belief.x, self._extrapolation.widened(belief.P, step, self._guess_error))

    def row(self, tick_ns: int) -> Outlook:
        """Return what is known for a tick, and remember the guess to learn from it."""
        rg = self._standalone
        if rg is None:
            n = self._paper_process.size
            return Outlook(Belief(np.zeros(n), self.settings.paper_start_P(n)), self._start)
        flown = Belief(rg.x, rg.P)
        if tick_ns <= self.known_ns:
            return Outlook(flown, self.camera_aided(tick_ns))
        last = self._history.last
        settled = self._history.settled_before(last)
        assert settled.P is not None
        step = self.inputs.ahead(last.t_ns, tick_ns)
        self._guesses[tick_ns] = (last.t_ns, step.dt * step.rates, step.live)
        return Outlook(
            flown,
            Belief(last.x, settled.P),
            step,
            (tick_ns - settled.t_ns) * 1e-9,
            last.trust.scale(step.live),
            self._guess_error,
        )

    def _learn(self, t_ns: int, step: GyroStep) -> None:
        """Compare the turn that was guessed up to ``t_ns`` with what the gyros said since.

        Pod by pod and axis by axis, without the filter's state: what the rows' uncertainty grows
        by ahead of the gyros does not depend on which frames have come.
        """
        self._turns.append((t_ns, step.dt * step.rates))
        guess = self._guesses.pop(t_ns, None)
        if guess is None:
            return
        since_ns, turned, live = guess
        if live != step.live:
            return
        truly = sum(turn for t, turn in self._turns if t > since_ns)
        error = self._guess_error
        self._guess_error = error + 0.05 * ((turned - truly) ** 2 - error)
