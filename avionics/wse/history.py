"""Out-of-sequence measurements by rewind: restore the frame's instant, update, repeat the steps."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.adaptive_noise import AdaptiveNoise
from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.process import DIFFERENCE_S, Process
from avionics.wse.state import Estimate
from avionics.wse.update import MarkerMeasurement, MarkerUpdate, UpdateResult

Array = NDArray[Any]

# Rates of all pods from one instant to another, under the regime of their grid step.
StepMaker = Callable[[int, int, Regime], GyroStep]

# No amplitude, bias or rate of a wing is as large as this, rad or rad/s: the filter is lost.
LARGEST_STATE = 100.0
# Longest run of nodes without a covariance: without frames it is followed at 10 Hz.
STEPS_PER_COVARIANCE = 10
DIFFERENCE_NS = round(1e9 * DIFFERENCE_S)


@dataclass(slots=True, eq=False)
class Node:
    """One instant of the history: how it was reached, what was measured, what was known after it.

    Attributes
    ----------
    t_ns : int
        Instant, ns.
    step : GyroStep or None
        From the node before; None at the first.
    measurement : MarkerMeasurement or None
        The frame exposed at this instant.
    gyro_now, gyro_before : GyroStep or None
        The rates at the instant itself and just before, where a measurement needs them.
    x, P, noise : ndarray, ndarray or None, AdaptiveNoise
        State after step and measurement. Covariances are computed where a measurement needs them,
        and every ``STEPS_PER_COVARIANCE`` otherwise.
    middle : ndarray or None
        Amplitudes at the middle of the step.
    result : UpdateResult or None
        What the update did.
    """

    t_ns: int
    step: GyroStep | None
    x: Array
    P: Array | None
    noise: AdaptiveNoise
    middle: Array | None = None
    measurement: MarkerMeasurement | None = None
    gyro_now: GyroStep | None = None
    gyro_before: GyroStep | None = None
    result: UpdateResult | None = None


class History:
    """The filter over a sliding window of nodes.

    Parameters
    ----------
    process, update : Process, MarkerUpdate
        The two halves of the filter.
    make_step : callable
        Gyro input between two instants inside the window.
    length_ns : int
        Oldest frame that can still be used.
    """

    def __init__(
        self, process: Process, update: MarkerUpdate, make_step: StepMaker, length_ns: int
    ) -> None:
        self._process = process
        self._update = update
        self.make_step = make_step
        self._length_ns = length_ns
        self.nodes: list[Node] = []
        self._times: list[int] = []

    def start(self, t_ns: int, estimate: Estimate, noise: AdaptiveNoise) -> None:
        """Place the first node."""
        self._start = (estimate, noise)
        self.nodes = [Node(t_ns, None, estimate.x, estimate.P, noise)]
        self._times = [t_ns]

    @property
    def last(self) -> Node:
        """The newest node."""
        return self.nodes[-1]

    def covers(self, t_ns: int) -> bool:
        """Return whether a frame at ``t_ns`` can be used."""
        return self._times[0] < t_ns <= self._times[-1]

    def append(self, t_ns: int, regime: Regime) -> GyroStep:
        """Step on to ``t_ns`` and return the step."""
        step = self.make_step(self._times[-1], t_ns, regime)
        last = self.nodes[-1]
        self.nodes.append(Node(t_ns, step, last.x, None, last.noise))
        self._times.append(t_ns)
        self._run_from(len(self.nodes) - 1)
        self._forget()
        return step

    def insert(self, measurement: MarkerMeasurement) -> UpdateResult:
        """Update at a frame's own time and repeat the steps after it; return what was done."""
        t_ns = measurement.t_ns
        i = bisect_left(self._times, t_ns)
        if self._times[i] == t_ns and self.nodes[i].measurement is None:
            node = self.nodes[i]
        else:
            i = bisect_right(self._times, t_ns)
            before, after = self.nodes[i - 1], self.nodes[min(i, len(self.nodes) - 1)]
            assert after.step is not None
            regime = after.step.regime
            step = self.make_step(before.t_ns, t_ns, regime)
            node = Node(t_ns, step, before.x, None, before.noise)
            if i < len(self.nodes):
                after.step = self.make_step(t_ns, after.t_ns, regime)
            self.nodes.insert(i, node)
            self._times.insert(i, t_ns)
        assert node.step is not None
        node.measurement = measurement
        if self._update.needs_motion:
            node.gyro_now = self.make_step(t_ns, t_ns, node.step.regime)
            before_ns = t_ns - DIFFERENCE_NS
            node.gyro_before = self.make_step(before_ns, before_ns, node.step.regime)
        self._run_from(i)
        assert node.result is not None
        return node.result

    def at(self, t_ns: int) -> Node:
        """Return the newest node not after ``t_ns``, or the oldest."""
        return self.nodes[max(bisect_right(self._times, t_ns) - 1, 0)]

    def regime_after(self, node: Node) -> Regime:
        """Return the regime of the step that leaves a node."""
        following = self.nodes[bisect_right(self._times, node.t_ns)].step
        assert following is not None
        return following.regime

    def _run_from(self, start: int) -> None:
        """Compute the states of all nodes from ``start`` on."""
        nodes = self.nodes
        known = start - 1
        while nodes[known].P is None:
            known -= 1
        for i in range(start, len(nodes)):
            before, node = nodes[i - 1], nodes[i]
            assert node.step is not None
            node.x, node.middle = self._process.move(before.x, node.step)
            node.P, node.noise = None, before.noise
            if node.measurement is not None:
                self._spread(known, i)
                self._update_node(node)
                known = i
            elif i - known >= STEPS_PER_COVARIANCE:
                self._spread(known, i)
                known = i

    def _spread(self, known: int, wanted: int) -> None:
        """Compute the covariances up to a node, all Jacobians in one batched call."""
        first, nodes = self.nodes[known], self.nodes[known + 1 : wanted + 1]
        steps = [node.step for node in nodes if node.step is not None]
        middles = [node.middle for node in nodes if node.middle is not None]
        assert first.P is not None
        covariances = self._process.spread(first.P, first.x, middles, steps, first.noise.scale_of)
        for node, P in zip(nodes, covariances, strict=True):
            node.P = P

    def _update_node(self, node: Node) -> None:
        """Fuse the measurement of a node; restart a filter that has lost the shape."""
        assert node.measurement is not None
        assert node.step is not None
        assert node.P is not None
        motion = self._process.still(node.step)
        if node.gyro_now is not None and node.gyro_before is not None:
            motion = self._process.motion(node.x, node.gyro_now, node.gyro_before)
        try:
            result = self._update.apply(
                Estimate(node.x, node.P), node.noise, node.measurement, motion
            )
            x = result.estimate.x
            is_lost = not (np.isfinite(x).all() and np.abs(x).max() < LARGEST_STATE)
        except np.linalg.LinAlgError:
            is_lost = True
        if is_lost:
            estimate, noise = self._start
            unused = np.zeros_like(node.measurement.found)
            result = UpdateResult(node.t_ns, estimate, noise, unused, lost=True)
        (node.x, node.P), node.noise, node.result = result.estimate, result.noise, result

    def known_before(self, node: Node) -> Node:
        """Return the newest node, not after this one, whose covariance is known."""
        i = bisect_right(self._times, node.t_ns) - 1
        while self.nodes[i].P is None:
            i -= 1
        return self.nodes[i]

    def _forget(self) -> None:
        cut = bisect_left(self._times, self._times[-1] - self._length_ns) - 1
        while cut > 0 and self.nodes[cut].P is None:
            cut -= 1
        if cut > 0:
            del self.nodes[:cut], self._times[:cut]

    @property
    def oldest_ns(self) -> int:
        """Time of the oldest node, ns."""
        return self._times[0]
