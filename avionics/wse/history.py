"""Time runs backwards here only: a late frame restores its instant, updates, repeats the steps."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.adaptive_noise import NO_VERDICT, Sighting, Trust, Verdict
from avionics.wse.gyro_step import GyroStep, Regime
from avionics.wse.process import DIFFERENCE_S, Process
from avionics.wse.update import MarkerUpdate

Array = NDArray[Any]

# Rates of all pods from one instant to another, under the regime of their grid step.
StepMaker = Callable[[int, int, Regime], GyroStep]

# No amplitude, bias or rate of a wing is as large as this, rad or rad/s: the filter is lost.
WILDEST = 100.0
# Longest run of nodes without a covariance: without frames it is followed at 10 Hz.
UNSETTLED_STEPS = 10
DIFFERENCE_NS = round(1e9 * DIFFERENCE_S)


@dataclass(slots=True, eq=False)
class Node:
    """One instant of the history: how it was reached, what was seen, what was known after it.

    Attributes
    ----------
    t_ns : int
        Instant, ns.
    step : GyroStep or None
        From the node before; None at the first.
    sighting : Sighting or None
        The frame exposed at this instant.
    gyro_now, gyro_before : GyroStep or None
        The rates at the instant itself and just before, where a sighting needs them.
    x, P, trust : ndarray, ndarray or None, Trust
        State after step and sighting. Covariances are computed where a sighting needs them, and
        every ``UNSETTLED_STEPS`` otherwise.
    middle : ndarray or None
        Amplitudes at the middle of the step.
    verdict : Verdict or None
        What the update did.
    """

    t_ns: int
    step: GyroStep | None
    x: Array
    P: Array | None
    trust: Trust
    middle: Array | None = None
    sighting: Sighting | None = None
    gyro_now: GyroStep | None = None
    gyro_before: GyroStep | None = None
    verdict: Verdict | None = None


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

    def begin(self, t_ns: int, x: Array, P: Array, trust: Trust) -> None:
        """Place the first node."""
        self._start = (x, P, trust)
        self.nodes = [Node(t_ns, None, x, P, trust)]
        self._times = [t_ns]

    @property
    def last(self) -> Node:
        """The newest node."""
        return self.nodes[-1]

    def covers(self, t_ns: int) -> bool:
        """Return whether a frame at ``t_ns`` can be taken."""
        return self._times[0] < t_ns <= self._times[-1]

    def append(self, t_ns: int, regime: Regime) -> GyroStep:
        """Step on to ``t_ns`` and return the step."""
        step = self.make_step(self._times[-1], t_ns, regime)
        last = self.nodes[-1]
        self.nodes.append(Node(t_ns, step, last.x, None, last.trust))
        self._times.append(t_ns)
        self._run_from(len(self.nodes) - 1)
        self._forget()
        return step

    def insert(self, sighting: Sighting) -> Node:
        """Take a frame at its own time and repeat what came after it; return its node."""
        t_ns = sighting.t_ns
        i = bisect_left(self._times, t_ns)
        if self._times[i] == t_ns and self.nodes[i].sighting is None:
            node = self.nodes[i]
        else:
            i = bisect_right(self._times, t_ns)
            before, after = self.nodes[i - 1], self.nodes[min(i, len(self.nodes) - 1)]
            assert after.step is not None
            regime = after.step.regime
            step = self.make_step(before.t_ns, t_ns, regime)
            node = Node(t_ns, step, before.x, None, before.trust)
            if i < len(self.nodes):
                after.step = self.make_step(t_ns, after.t_ns, regime)
            self.nodes.insert(i, node)
            self._times.insert(i, t_ns)
        assert node.step is not None
        node.sighting = sighting
        if self._update.needs_motion:
            node.gyro_now = self.make_step(t_ns, t_ns, node.step.regime)
            before_ns = t_ns - DIFFERENCE_NS
            node.gyro_before = self.make_step(before_ns, before_ns, node.step.regime)
        self._run_from(i)
        return node

    def at(self, t_ns: int) -> Node:
        """Return the newest node not after ``t_ns``, or the oldest."""
        return self.nodes[max(bisect_right(self._times, t_ns) - 1, 0)]

    def regime_after(self, node: Node) -> Regime:
        """Return what holds in the step that leaves a node."""
        following = self.nodes[bisect_right(self._times, node.t_ns)].step
        assert following is not None
        return following.regime

    def _run_from(self, start: int) -> None:
        """Compute the states of all nodes from ``start`` on."""
        nodes = self.nodes
        settled = start - 1
        while nodes[settled].P is None:
            settled -= 1
        for i in range(start, len(nodes)):
            before, node = nodes[i - 1], nodes[i]
            assert node.step is not None
            node.x, node.middle = self._process.move(before.x, node.step)
            node.P, node.trust = None, before.trust
            if node.sighting is not None:
                self._settle(settled, i)
                self._see(node)
                settled = i
            elif i - settled >= UNSETTLED_STEPS:
                self._settle(settled, i)
                settled = i

    def _settle(self, known: int, wanted: int) -> None:
        """Compute the covariances up to a node, all Jacobians in one batched call."""
        first, nodes = self.nodes[known], self.nodes[known + 1 : wanted + 1]
        steps = [node.step for node in nodes if node.step is not None]
        middles = [node.middle for node in nodes if node.middle is not None]
        assert first.P is not None
        covariances = self._process.spread(first.P, first.x, middles, steps, first.trust.scale)
        for node, P in zip(nodes, covariances, strict=True):
            node.P = P

    def _see(self, node: Node) -> None:
        """Fuse the sighting of a node; a filter that has lost itself starts anew."""
        assert node.sighting is not None
        assert node.step is not None
        assert node.P is not None
        motion = self._process.still(node.step)
        if node.gyro_now is not None and node.gyro_before is not None:
            motion = self._process.motion(node.x, node.gyro_now, node.gyro_before)
        try:
            x, P, trust, verdict = self._update.apply(
                node.x, node.P, node.trust, node.sighting, motion
            )
            is_lost = not (np.isfinite(x).all() and np.abs(x).max() < WILDEST)
        except np.linalg.LinAlgError:
            is_lost = True
        if is_lost:
            x, P, trust = self._start
            verdict = replace(NO_VERDICT, used=np.zeros_like(node.sighting.found), lost=True)
        node.x, node.P, node.trust, node.verdict = x, P, trust, verdict

    def settled_before(self, node: Node) -> Node:
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
