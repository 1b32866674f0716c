"""What a distributed-POS study is: a validated TOML file; unknown keys are errors.

Ready specifications lie in ``specs``. Everything that leaves here is SI and radians.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from avionics.config.load import read_toml
from avionics.errors import ConfigError
from avionics.pos.metrics import Segment
from avionics.pos.motion import half_step_times, motion_along_legs
from avionics.pos.simulate import Arm, Node, Sampling
from avionics.pos.study.tables import (
    LegTable,
    MethodTable,
    NodeTable,
    NoiseReading,
    ReferenceTable,
    SegmentTable,
    SensorsTable,
    StartTable,
    Table,
    Triple,
    TruthTable,
    WobbleTable,
    explain_all,
)
from avionics.pos.trajectory import Trajectory, trajectory_from_motion
from avionics.pos.wobble import add_wobble

READY = ("gong-table2", "gong-table4", "guo-table1")
FOLDER = Path(__file__).parent / "specs"


class ChangeTable(Table):
    """One thing changed against a profile, to see what it turns on and off."""

    name: str
    about: str = ""
    gyro: Sampling | None = None
    arm: Arm | None = None
    banked: bool | None = None
    noise: NoiseReading | None = None
    wobble: bool | None = None
    flexure_scale: float | None = Field(default=None, gt=0)
    method: dict[str, Any] = Field(default={}, description="keys of every method to replace")


class ProfileTable(Table):
    """A reading of the paper: what is true, which filters run, and which changes explain it."""

    about: str = ""
    truth: TruthTable = TruthTable()
    methods: tuple[MethodTable, ...] = Field(min_length=1)
    changes: tuple[ChangeTable, ...] = ()
    unexplained: str = Field(default="", description="differences that no change accounts for")

    @model_validator(mode="after")
    def _is_consistent(self) -> "ProfileTable":
        names = [method.name for method in self.methods]
        if len(set(names)) != len(names):
            msg = f"method names {names} are not unique"
            raise ValueError(msg)
        for change in self.changes:
            self.changed(change)
        return self

    def changed(self, change: ChangeTable) -> "ProfileTable":
        """Return this profile with one thing changed."""
        keys = TruthTable.model_fields
        truth = {key: getattr(change, key) for key in keys if getattr(change, key) is not None}
        methods = tuple(
            MethodTable.model_validate({**method.model_dump(), "smooth": False, **change.method})
            for method in self.methods
        )
        return ProfileTable(
            about=self.about, truth=self.truth.model_copy(update=truth), methods=methods
        )


class PublishedTable(Table):
    """Printed figures of the paper, arcmin; -1 where it prints none."""

    scenario: str
    method: str
    segment: str = "mean"
    quantity: Literal["system", "misalignment", "flexure"] = "system"
    std: Triple
    rmse: Triple


class Spec(Table):
    """A study."""

    title: str
    source: str
    about: str = ""
    seeds: tuple[int, int] = (1, 10)
    step_s: float = Field(default=0.01, gt=0, le=0.1)
    ramp_s: float = Field(default=5.0, gt=0)
    start: StartTable
    legs: tuple[LegTable, ...] = Field(min_length=1)
    wobble: WobbleTable | None = None
    sensors: SensorsTable
    reference: ReferenceTable
    node: NodeTable
    segments: tuple[SegmentTable, ...] = Field(min_length=1)
    published: tuple[PublishedTable, ...] = ()
    profiles: dict[str, ProfileTable] = Field(min_length=1)

    @model_validator(mode="after")
    def _is_consistent(self) -> "Spec":
        duration = sum(leg.duration_s for leg in self.legs)
        for segment in self.segments:
            if not segment.from_s < segment.to_s <= duration:
                msg = (
                    f"segment {segment.name}: {segment.from_s} to {segment.to_s} s does not lie "
                    f"inside the legs, 0 to {duration:g} s"
                )
                raise ValueError(msg)
        if self.seeds[0] < 0 or self.seeds[1] < self.seeds[0]:
            msg = f"seeds: {list(self.seeds)}, wants first <= last, both from 0"
            raise ValueError(msg)
        return self

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the runs over the trajectory: with speed variation if the legs have one."""
        if any(leg.variation_m_s for leg in self.legs):
            return ("no variation", "with variation")
        return ("drive",) if self.wobble is not None else ("flight",)

    def trajectory(self, scenario: str, truth: TruthTable) -> Trajectory:
        """Return the carrier's motion."""
        legs = tuple(leg.leg(varied=scenario == "with variation") for leg in self.legs)
        start = self.start.start()
        times = half_step_times(sum(leg.duration for leg in legs), self.step_s)
        motion = motion_along_legs(times, legs, start, banked=truth.banked, ramp=self.ramp_s)
        if self.wobble is not None and truth.wobble:
            motion = add_wobble(motion, legs, self.wobble.wobble(), start.speed)
        return trajectory_from_motion(motion, start)

    def slave(self, truth: TruthTable, arm: Arm | None = None) -> Node:
        """Return the slave node as it is true in a run."""
        law = self.node.flexure()
        return Node(
            rho=np.deg2rad(np.array(self.node.misalignment_deg)),
            r0=np.array(self.node.lever_arm_m),
            flexure=replace(law, sigma=truth.flexure_scale * law.sigma),
            master=self.sensors.master.grade(truth.noise, self.step_s),
            slave=self.sensors.slave.grade(truth.noise, self.step_s),
            reference=self.reference.reference(),
            gyro=truth.gyro,
            arm=arm or truth.arm,
        )

    def segment_list(self) -> tuple[Segment, ...]:
        """Return the segments."""
        return tuple(table.segment() for table in self.segments)


def load_spec(name: str) -> Spec:
    """Return a ready specification by name, or the one in a TOML file.

    Raises
    ------
    ConfigError
        If there is none of that name, or it does not validate; file and key are named.
    """
    if name in READY:
        return parse_spec(read_toml(FOLDER / f"{name}.toml"), origin=name)
    path = Path(name)
    if path.suffix != ".toml":
        msg = f"'{name}' is no study: give a .toml file or one of {', '.join(READY)}"
        raise ConfigError(msg)
    return parse_spec(read_toml(path), origin=name)


def parse_spec(tables: dict[str, Any], *, origin: str) -> Spec:
    """Validate the tables of a specification.

    Raises
    ------
    ConfigError
        Naming file, key, value and what was wanted.
    """
    try:
        return Spec.model_validate(tables)
    except ValidationError as error:
        lines = explain_all(origin, error)[:2]
        raise ConfigError("\n".join(lines)) from None
