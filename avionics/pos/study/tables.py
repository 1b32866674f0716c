"""The tables of a distributed-POS specification in units for people, and what they are in SI."""

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from avionics.config.load import explain
from avionics.pos.beam import Beam, modes
from avionics.pos.earth import STANDARD_GRAVITY
from avionics.pos.flexure import Flexure, markov_flexure
from avionics.pos.methods import Kind, Method
from avionics.pos.metrics import Segment
from avionics.pos.motion import Leg, Start
from avionics.pos.simulate import Arm, Grade, Reference, Sampling
from avionics.pos.wobble import Wobble

Triple = tuple[float, float, float]
NoiseReading = Literal["per-sample", "deg/sqrt(h)"]
DEG_H = float(np.deg2rad(1.0) / 3600.0)
DEG_SQRT_H = float(np.deg2rad(1.0) / 60.0)
MICRO_G = 1e-6 * STANDARD_GRAVITY
BEAM_ELEMENTS = 64


def explain_all(origin: str, error: ValidationError) -> list[str]:
    """Return a line on every fault, misspelt keys first: they explain the missing ones."""
    items = sorted(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    return [explain(origin, item) for item in items]


class Table(BaseModel):
    """A table: an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class StartTable(Table):
    """Where the flight or drive begins."""

    latitude_deg: float = Field(ge=-85, le=85)
    longitude_deg: float = Field(ge=-180, le=180)
    height_m: float
    heading_deg: float
    speed_m_s: float = Field(ge=0)

    def start(self) -> Start:
        """Return it in SI."""
        rad = np.deg2rad([self.latitude_deg, self.longitude_deg, self.heading_deg])
        return Start(float(rad[0]), float(rad[1]), self.height_m, float(rad[2]), self.speed_m_s)


class LegTable(Table):
    """One leg; ``variation_m_s`` is added to the change of speed in the run with variation."""

    duration_s: float = Field(gt=0)
    turn_deg: float = 0.0
    speed_change_m_s: float = 0.0
    climb_m: float = 0.0
    variation_m_s: float = 0.0

    def leg(self, *, varied: bool) -> Leg:
        """Return it in SI."""
        change = self.speed_change_m_s + (self.variation_m_s if varied else 0.0)
        return Leg(self.duration_s, float(np.deg2rad(self.turn_deg)), change, self.climb_m)


class WobbleTable(Table):
    """Vehicle wobble, rms at speed."""

    heading_deg: float = Field(ge=0)
    pitch_deg: float = Field(ge=0)
    roll_deg: float = Field(ge=0)
    from_hz: float = Field(default=0.05, gt=0)
    to_hz: float = Field(default=3.0, gt=0)

    def wobble(self) -> Wobble:
        """Return it in SI."""
        heading, pitch, roll = np.deg2rad([self.heading_deg, self.pitch_deg, self.roll_deg])
        return Wobble(float(heading), float(pitch), float(roll), self.from_hz, self.to_hz)


class GradeTable(Table):
    """Inertial sensors of one node, one-sigma; noise is per sample."""

    gyro_bias_deg_h: float = Field(ge=0)
    gyro_noise_deg_h: float = Field(ge=0)
    force_bias_ug: float = Field(ge=0)
    force_noise_ug: float = Field(ge=0)

    def grade(self, reading: NoiseReading, step_s: float) -> Grade:
        """Return it in SI; the other reading takes the gyro noise as deg/sqrt(h)."""
        noise = self.gyro_noise_deg_h * DEG_H
        if reading == "deg/sqrt(h)":
            noise = self.gyro_noise_deg_h * DEG_SQRT_H / float(np.sqrt(step_s))
        return Grade(
            self.gyro_bias_deg_h * DEG_H, noise,
            self.force_bias_ug * MICRO_G, self.force_noise_ug * MICRO_G,
        )  # fmt: skip


class ReferenceTable(Table):
    """The master's navigation solution, one-sigma, white per sample."""

    heading_deg: float = Field(gt=0)
    pitch_deg: float = Field(gt=0)
    roll_deg: float = Field(gt=0)
    velocity_m_s: float = Field(gt=0)

    def reference(self) -> Reference:
        """Return it in SI."""
        heading, pitch, roll = np.deg2rad([self.heading_deg, self.pitch_deg, self.roll_deg])
        return Reference(float(heading), float(pitch), float(roll), self.velocity_m_s)


class MarkovTable(Table):
    """Second-order Markov flexure about x, y, z."""

    correlation_s: Triple
    variance_deg2: Triple

    def flexure(self) -> Flexure:
        """Return it in SI."""
        sigma = np.deg2rad(np.sqrt(np.array(self.variance_deg2)))
        return markov_flexure(np.array(self.correlation_s), sigma)


class WingTable(Table):
    """A Timoshenko cantilever whose first mode bends about y."""

    length_m: float = Field(gt=0)
    width_m: float = Field(gt=0)
    thickness_m: float = Field(gt=0)
    youngs_gpa: float = Field(default=70.0, gt=0)
    shear_gpa: float = Field(default=26.9, gt=0)
    density_kg_m3: float = Field(default=2700.0, gt=0)
    damping: float = Field(default=0.03, gt=0, le=1)
    sigma_deg: float = Field(gt=0)

    def beam(self) -> Beam:
        """Return the beam."""
        return Beam(
            self.length_m, self.width_m, self.thickness_m,
            self.youngs_gpa * 1e9, self.shear_gpa * 1e9, self.density_kg_m3,
        )  # fmt: skip

    def flexure(self) -> Flexure:
        """Return the first mode as an oscillator about y; the other axes are stiff."""
        frequency = float(modes(self.beam(), BEAM_ELEMENTS, 1)[0][0])
        sigma = float(np.deg2rad(self.sigma_deg))
        return Flexure(
            np.array([1.0, frequency, 1.0]),
            np.array([1.0, self.damping, 1.0]),
            np.array([0.0, sigma, 0.0]),
        )


class NodeTable(Table):
    """The slave node: exactly one of markov and wing."""

    misalignment_deg: Triple
    lever_arm_m: Triple
    markov: MarkovTable | None = None
    wing: WingTable | None = None

    @model_validator(mode="after")
    def _has_one_flexure(self) -> "NodeTable":
        if (self.markov is None) == (self.wing is None):
            msg = "wants exactly one of the tables markov and wing"
            raise ValueError(msg)
        return self

    def flexure(self) -> Flexure:
        """Return the flexure law."""
        table = self.markov or self.wing
        assert table is not None
        return table.flexure()


class SensorsTable(Table):
    """Inertial sensors of both nodes."""

    master: GradeTable
    slave: GradeTable


class SegmentTable(Table):
    """Where errors are counted."""

    name: str
    from_s: float = Field(ge=0)
    to_s: float = Field(gt=0)

    def segment(self) -> Segment:
        """Return it."""
        return Segment(self.name, self.from_s, self.to_s)


class MethodTable(Table):
    """One line of a table: a method, its options, and what of the truth differs for it."""

    name: str
    kind: Kind
    nonlinear: bool = True
    every: int = Field(default=1, ge=1)
    arm_rate: bool = True
    sampling_noise: float = Field(default=0.0, ge=0)
    arm_in_h: bool = True
    arm_model: bool = False
    damping: float | None = Field(default=None, gt=0, le=1)
    rho_sigma_deg: float = Field(default=0.5, gt=0)
    arm: Arm | None = Field(default=None, description="truth for this method alone")
    smooth: bool = False

    def method(self, gyro: Sampling) -> Method:
        """Return it in SI, for gyros that sample so."""
        return Method(
            kind=self.kind,
            nonlinear=self.nonlinear,
            sampling=gyro,
            rho_sigma=float(np.deg2rad(self.rho_sigma_deg)),
            every=self.every,
            arm_rate=self.arm_rate,
            sampling_noise=self.sampling_noise,
            arm_in_H=self.arm_in_h,
            arm_model=self.arm_model,
            damping=self.damping,
        )


class TruthTable(Table):
    """What is true in a run, where the papers leave it open."""

    gyro: Sampling = "integrating"
    arm: Arm = "flexing"
    banked: bool = True
    noise: NoiseReading = "per-sample"
    wobble: bool = True
    flexure_scale: float = Field(default=1.0, gt=0, description="factor on the flexure's sigma")
