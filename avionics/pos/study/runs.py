"""Runs of a distributed-POS study: seeds by methods by scenarios, two at a time."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from avionics.pos.compiled import Array
from avionics.pos.estimate import Estimate
from avionics.pos.methods import estimate
from avionics.pos.metrics import Statistics, errors, sigmas, statistics
from avionics.pos.simulate import Measured, Node, SlaveTruth, simulate
from avionics.pos.study.bounds import riccati_bounds
from avionics.pos.study.spec import ChangeTable, ProfileTable, Spec
from avionics.pos.study.tables import MethodTable
from avionics.pos.trajectory import Trajectory

WORKERS = 2
STRIDE = 5  # outputs at a fifth of the sample rate: errors are counted and drawn from these


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Errors of one run over time, for figures.

    Attributes
    ----------
    t : ndarray, shape (K,)
        s.
    error, sigma : ndarray, shape (3, K, 3)
        By quantity (system, misalignment, flexure), instant, axis, rad.
    """

    t: Array
    error: Array
    sigma: Array


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One line of a table: a method in a scenario, over the seeds.

    Attributes
    ----------
    scenario, method : str
        Names; a smoothed estimate is a method of its own, "... smoothed".
    seeds : tuple of int
        The runs.
    runs : tuple of Statistics
        One for each seed.
    trace : Trace
        The first seed's run.
    """

    scenario: str
    method: str
    seeds: tuple[int, ...]
    runs: tuple[Statistics, ...]
    trace: Trace

    def mean(self, what: str, quantity: int = 0) -> Array:
        """Return the mean over segments and runs of "std", "rmse" or "sigma", rad, shape (3,)."""
        result: Array = self.by_run(what, quantity).mean(axis=0)
        return result

    def spread(self, what: str, quantity: int = 0, segment: int = -1) -> Array:
        """Return the standard deviation over the runs, rad, shape (3,); -1: of the mean."""
        values = self.by_run(what, quantity)
        if segment >= 0:
            values = np.array([getattr(run, what)[quantity, segment] for run in self.runs])
        return values.std(axis=0, ddof=1) if len(values) > 1 else np.full(3, np.nan)

    def by_run(self, what: str, quantity: int = 0) -> Array:
        """Return the mean over the segments for each run, rad, shape (R, 3)."""
        return np.array([getattr(run, what)[quantity].mean(axis=0) for run in self.runs])

    def segment(self, what: str, segment: int, quantity: int = 0) -> Array:
        """Return the mean over the runs in one segment, rad, shape (3,)."""
        values = np.array([getattr(run, what)[quantity, segment] for run in self.runs])
        result: Array = values.mean(axis=0)
        return result

    def pooled(self, what: str, quantity: int = 0) -> Array:
        """Return the mean over the runs of "std" or "rmse", segments pooled, rad, shape (3,)."""
        values = np.array([getattr(run, f"{what}_pooled")[quantity] for run in self.runs])
        result: Array = values.mean(axis=0)
        return result

    def consistency(self, quantity: int = 0) -> Array:
        """Return the rms over the runs of error by predicted sigma, shape (3,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.by_run("rmse", quantity) / self.by_run("sigma", quantity)
        result: Array = np.sqrt(np.mean(ratio**2, axis=0))
        return result


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """Everything that ran.

    Attributes
    ----------
    name, profile : str
        The specification's name and the profile.
    spec : Spec
        The specification.
    seeds : tuple of int
        The runs.
    lines : tuple of Line
        The table.
    changes : dict of str to tuple of Line
        The table with one thing changed, by the change's name; fewer seeds.
    trajectories : dict of str to Trajectory
        By scenario.
    truth : SlaveTruth
        The first seed's, first scenario.
    bounds : dict of str to ndarray, shape (3,)
        Riccati bound by method in the first scenario, rad, where it was asked for.
    """

    name: str
    profile: str
    spec: Spec
    seeds: tuple[int, ...]
    lines: tuple[Line, ...]
    changes: dict[str, tuple[Line, ...]] = field(default_factory=dict)
    trajectories: dict[str, Trajectory] = field(default_factory=dict)
    truth: SlaveTruth | None = None
    bounds: dict[str, Array] = field(default_factory=dict)

    def line(self, scenario: str, method: str) -> Line | None:
        """Return a line by name, or None."""
        for line in self.lines:
            if (line.scenario, line.method) == (scenario, method):
                return line
        return None


Progress = Callable[[float], None]


def run_study(
    name: str,
    spec: Spec,
    profile: str,
    *,
    seeds: Sequence[int],
    scenarios: Sequence[str],
    change_seeds: Sequence[int] = (),
    carrier: Trajectory | None = None,
    with_bounds: bool = False,
    progress: Progress | None = None,
) -> Study:
    """Run a profile of a specification, and each of its changes.

    Parameters
    ----------
    name : str
        Of the specification.
    spec : Spec
        The study.
    profile : str
        Which of its profiles.
    seeds : sequence of int
        Runs of the table.
    scenarios : sequence of str
        Some of ``spec.scenarios``.
    change_seeds : sequence of int
        Runs of each change, first scenario only; none leaves the changes out.
    carrier : Trajectory, optional
        Motion to use instead of the specification's legs, in every scenario.
    with_bounds : bool
        Also compute the Riccati bounds; they take longer than a run.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    table = spec.profiles[profile]
    changes = table.changes if change_seeds else ()
    total = len(scenarios) * len(seeds) + len(changes) * len(change_seeds)
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / total)

    trajectories = {
        scenario: carrier or spec.trajectory(scenario, table.truth) for scenario in scenarios
    }
    lines: list[Line] = []
    for scenario in scenarios:
        lines += run_lines(spec, table, scenario, trajectories[scenario], seeds=seeds, tick=tick)
    changed = {
        change.name: tuple(
            _run_change(spec, table, change, scenario=scenarios[0], seeds=change_seeds, tick=tick)
        )
        for change in changes
    }
    first = trajectories[scenarios[0]]
    truth, _ = simulate(first, spec.slave(table.truth), np.random.default_rng(seeds[0]))
    bounds = riccati_bounds(spec, table, first, seeds[0]) if with_bounds else {}
    return Study(
        name, profile, spec, tuple(seeds), tuple(lines), changed, trajectories, truth, bounds
    )


def _run_change(
    spec: Spec,
    table: ProfileTable,
    change: ChangeTable,
    *,
    scenario: str,
    seeds: Sequence[int],
    tick: Callable[[], None],
) -> list[Line]:
    changed = table.changed(change)
    trajectory = spec.trajectory(scenario, changed.truth)
    return run_lines(spec, changed, scenario, trajectory, seeds=seeds, tick=tick)


def run_lines(
    spec: Spec,
    table: ProfileTable,
    scenario: str,
    trajectory: Trajectory,
    *,
    seeds: Sequence[int],
    tick: Callable[[], None] = lambda: None,
) -> list[Line]:
    """Return one line for each estimate that a profile makes on a trajectory.

    Parameters
    ----------
    spec, table : Spec, ProfileTable
        The study and the reading of it.
    scenario, trajectory : str, Trajectory
        Name and motion of the carrier.
    seeds : sequence of int
        The runs; each has a generator of its own, so that a run does not depend on the others.
    tick : callable
        Called after every run.
    """

    def one(seed: int) -> dict[str, tuple[Statistics, Trace | None]]:
        return dict(_run_seed(spec, table, trajectory, seed, keep=seed == seeds[0]))

    results: list[dict[str, tuple[Statistics, Trace | None]]] = []
    with ThreadPoolExecutor(max_workers=WORKERS) as pool:
        for result in pool.map(one, seeds):
            results.append(result)
            tick()
    lines = []
    for method in results[0]:
        trace = results[0][method][1]
        assert trace is not None
        runs = tuple(result[method][0] for result in results)
        lines.append(Line(scenario, method, tuple(seeds), runs, trace))
    return lines


def _run_seed(
    spec: Spec, table: ProfileTable, trajectory: Trajectory, seed: int, *, keep: bool
) -> Iterator[tuple[str, tuple[Statistics, Trace | None]]]:
    """Simulate once for each kind of arm, run every method, and count."""
    simulated: dict[str, tuple[Node, SlaveTruth, Measured]] = {}
    for method in table.methods:
        node = spec.slave(table.truth, method.arm)
        if node.arm not in simulated:
            truth, measured = simulate(trajectory, node, np.random.default_rng(seed))
            simulated[node.arm] = (node, truth, measured)
        for name, found in _estimates(method, table, trajectory, simulated[node.arm]):
            truth = simulated[node.arm][1]
            figures = statistics(found, truth, trajectory.dt, spec.segment_list())
            trace = None
            if keep:
                t = found.index.astype(np.float64) * trajectory.dt
                trace = Trace(t, errors(found, truth), sigmas(found))
            yield name, (figures, trace)


def _estimates(
    method: MethodTable,
    table: ProfileTable,
    trajectory: Trajectory,
    simulated: tuple[Node, SlaveTruth, Measured],
) -> Iterator[tuple[str, Estimate]]:
    node, _, measured = simulated
    made = estimate(
        method.method(table.truth.gyro), measured, node, trajectory,
        stride=STRIDE, smooth=method.smooth,
    )  # fmt: skip
    yield method.name, made.filtered
    if made.smoothed is not None:
        yield f"{method.name} smoothed", made.smoothed
