"""Which sensors a node needs: covariance analysis of every method, without a random draw."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError, model_validator

from avionics.config.load import read_toml
from avionics.errors import ConfigError
from avionics.pos.compiled import Array
from avionics.pos.estimate import Estimate
from avionics.pos.methods import Method, covariance_analysis
from avionics.pos.motion import half_step_times, motion_along_legs
from avionics.pos.simulate import Node
from avionics.pos.study.results import ARCMIN
from avionics.pos.study.runs import STRIDE, WORKERS
from avionics.pos.study.spec import FOLDER
from avionics.pos.study.tables import (
    GradeTable,
    LegTable,
    MarkovTable,
    ReferenceTable,
    SegmentTable,
    StartTable,
    Table,
    Triple,
    explain_all,
)
from avionics.pos.trajectory import Trajectory, trajectory_from_motion

READY = ("wing-nodes",)
METHODS: dict[str, Method] = {
    "Gs": Method("gs"),
    "As": Method("as", nonlinear=False, arm_model=True),
    "IMU": Method("imu"),
    "GA": Method("ga", arm_model=True),
}
SENSORS = {
    "Gs": "three gyros (Gs)",
    "As": "three accelerometers (As)",
    "IMU": "an IMU (transfer alignment)",
    "GA": "an IMU (gyros and accelerometers compared, GA)",
}
"""Cheapest first: the first method that meets the requirement is the answer."""


class NamedGrade(GradeTable):
    """A grade of sensors to choose from."""

    name: str


class DesignNode(Table):
    """A node: what it stands on."""

    name: str
    misalignment_deg: float = Field(gt=0, description="one-sigma, before alignment")
    lever_arm_m: Triple
    markov: MarkovTable


class Design(Table):
    """A question: nodes, grades, a trajectory, a requirement."""

    title: str
    about: str = ""
    required_arcmin: Triple
    step_s: float = Field(default=0.01, gt=0, le=0.1)
    banked: bool = True
    start: StartTable
    legs: tuple[LegTable, ...] = Field(min_length=1)
    segments: tuple[SegmentTable, ...] = Field(min_length=1)
    master: GradeTable
    reference: ReferenceTable
    grades: tuple[NamedGrade, ...] = Field(min_length=1)
    nodes: tuple[DesignNode, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _segments_lie_inside(self) -> "Design":
        duration = sum(leg.duration_s for leg in self.legs)
        for segment in self.segments:
            if not segment.from_s < segment.to_s <= duration:
                msg = f"segment {segment.name} does not lie inside the legs, 0 to {duration:g} s"
                raise ValueError(msg)
        return self

    def trajectory(self) -> Trajectory:
        """Return the carrier's motion."""
        legs = tuple(leg.leg(varied=False) for leg in self.legs)
        times = half_step_times(sum(leg.duration for leg in legs), self.step_s)
        start = self.start.start()
        return trajectory_from_motion(
            motion_along_legs(times, legs, start, banked=self.banked), start
        )

    def node(self, node: DesignNode, grade: NamedGrade) -> Node:
        """Return a node with sensors of a grade."""
        return Node(
            rho=np.zeros(3),
            r0=np.array(node.lever_arm_m),
            flexure=node.markov.flexure(),
            master=self.master.grade("per-sample", self.step_s),
            slave=grade.grade("per-sample", self.step_s),
            reference=self.reference.reference(),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """One method on one node with one grade.

    Attributes
    ----------
    node, grade, method : str
        Names.
    sigma, smoothed_sigma : ndarray, shape (3,)
        Predicted one-sigma of the system error angle in the segments, arcmin.
    """

    node: str
    grade: str
    method: str
    sigma: Array
    smoothed_sigma: Array


def load_design(name: str) -> Design:
    """Return a ready design by name, or the one in a TOML file.

    Raises
    ------
    ConfigError
        If there is none of that name, or it does not validate.
    """
    if name in READY:
        return parse_design(read_toml(FOLDER / f"{name}.toml"), origin=name)
    path = Path(name)
    if path.suffix != ".toml":
        msg = f"'{name}' is no design: give a .toml file or {', '.join(READY)}"
        raise ConfigError(msg)
    return parse_design(read_toml(path), origin=name)


def parse_design(tables: dict[str, Any], *, origin: str) -> Design:
    """Validate the tables of a design; errors name file and key."""
    try:
        return Design.model_validate(tables)
    except ValidationError as error:
        lines = explain_all(origin, error)[:2]
        raise ConfigError("\n".join(lines)) from None


def analyse(design: Design, progress: Callable[[float], None] | None = None) -> list[Cell]:
    """Return every method on every node with every grade.

    Parameters
    ----------
    design : Design
        The question.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    trajectory = design.trajectory()
    jobs = [(n, g, m) for n in design.nodes for g in design.grades for m in METHODS]

    def one(job: tuple[DesignNode, NamedGrade, str]) -> Cell:
        node, grade, name = job
        method = replace(METHODS[name], rho_sigma=float(np.deg2rad(node.misalignment_deg)))
        found = covariance_analysis(method, design.node(node, grade), trajectory, stride=STRIDE)
        assert found.smoothed is not None
        filtered, smoothed = (
            _sigma(design, item, trajectory.dt) for item in (found.filtered, found.smoothed)
        )
        return Cell(node.name, grade.name, name, filtered, smoothed)

    cells = []
    with ThreadPoolExecutor(max_workers=WORKERS) as pool:
        for cell in pool.map(one, jobs):
            cells.append(cell)
            if progress is not None:
                progress(len(cells) / len(jobs))
    return cells


def _sigma(design: Design, found: Estimate, dt: float) -> Array:
    """Rms over the segments of the predicted one-sigma, arcmin, shape (3,)."""
    t = found.index * dt
    inside = np.any([(t >= s.from_s) & (t <= s.to_s) for s in design.segments], axis=0)
    result: Array = np.sqrt(np.mean(found.system_sigma[inside] ** 2, axis=0)) * ARCMIN
    return result


def cheapest_sensors(design: Design, cells: list[Cell], node: str, grade: str) -> str:
    """Return the cheapest set of sensors that meets the requirement on every axis."""
    required = np.array(design.required_arcmin)
    mine = {cell.method: cell for cell in cells if (cell.node, cell.grade) == (node, grade)}
    for method, words in SENSORS.items():
        if np.all(mine[method].sigma <= required):
            return words
    for method, words in SENSORS.items():
        if np.all(mine[method].smoothed_sigma <= required):
            return f"{words}, smoothed afterwards"
    return "nothing of this grade"
