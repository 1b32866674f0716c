"""Flights described in TOML: what the wing is, what pushes it, what goes wrong.

Unknown keys are errors. Which pods and markers it carries is the configuration's, not the
scenario's.
"""

import sys
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from avionics.config.load import explain
from avionics.errors import ConfigError
from sim_bus.buses.faults import KINDS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Vector3 = tuple[float, float, float]
DOWN: Vector3 = (0.0, 0.0, 1.0)


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class WingProperties(_Section):
    """The simulated wing. Defaults: a 1.5 m foam-and-spar mockup, 1.8 Hz, 6 deg of sag."""

    elements: int = Field(default=20, ge=4, le=60)
    mass_per_m: float = Field(default=0.40, gt=0, description="kg/m")
    tip_mass_kg: float = Field(default=0.02, ge=0)
    chord_m: float = Field(default=0.25, gt=0)
    cg_aft_m: float = Field(default=0.008, description="centre of gravity aft of the line")
    ei_out_n_m2: float = Field(default=20.0, gt=0, description="bending out of the plane")
    ei_in_n_m2: float = Field(default=450.0, gt=0, description="bending in the plane")
    gj_n_m2: float = Field(default=14.0, gt=0, description="torsion")
    ea_n: float = Field(default=2e5, gt=0, description="axial stiffness")
    bend_twist_n_m2: float = Field(default=0.0, description="coupling of bending with torsion")
    taper: float = Field(default=0.0, ge=0, lt=1, description="loss of stiffness root to tip")
    damping_s: float = Field(default=6e-4, ge=0, description="structural: damping = this * K")
    air_damping_n_s_m2: float = Field(default=0.12, ge=0, description="still air, per metre")
    lift_slope_per_rad: float = Field(default=4.5, ge=0)
    step_s: float = Field(default=0.002, gt=0, le=0.01)


class Swing(_Section):
    """One sine of the root, in an angle or a position."""

    axis: Literal["roll", "pitch", "yaw", "north", "east", "down"]
    amplitude: float = Field(description="deg, or m")
    hz: float = Field(gt=0)
    phase_deg: float = 0.0
    at_s: float = Field(default=1.0, ge=0)
    for_s: float = Field(default=1e6, gt=0)
    fade_s: float = Field(default=2.0, gt=0)


class Force(_Section):
    """A force at the tip: rises smoothly, stays or swings, ends abruptly (release) or smoothly."""

    kind: Literal["force"]
    at_s: float = Field(ge=0)
    for_s: float = Field(gt=0)
    newtons: float
    direction: Vector3 = Field(default=DOWN, description="body axes; need not be of unit length")
    follows_tip: bool = Field(default=False, description="direction in the tip section's axes")
    torque_nm: float = Field(default=0.0, description="twisting couple at the tip, same history")
    hz: float = Field(default=0.0, ge=0, description="0: steady")
    rise_s: float = Field(default=0.5, gt=0)
    fall_s: float = Field(default=0.0, ge=0, description="0: let go")


class Sweep(_Section):
    """A hand on a rod that moves the tip along one direction, from slow to fast, then lets go.

    Displacement is what it commands, so the wing cannot run away at its first resonance; blocks
    of ``block_s`` alternate between the whole amplitude and ``small`` of it, and the tip's speed
    and acceleration are bounded.
    """

    kind: Literal["sweep"]
    at_s: float = Field(ge=0)
    for_s: float = Field(gt=0)
    from_hz: float = Field(default=0.2, gt=0)
    to_hz: float = Field(default=6.0, gt=0)
    amplitude_m: float = Field(default=0.45, gt=0)
    offset_m: float = Field(default=0.0, description="mean position against rest, along direction")
    speed_m_s: float = Field(default=1.6, gt=0, description="bound of the tip's speed")
    accel_m_s2: float = Field(default=14.0, gt=0, description="bound of its acceleration")
    small: float = Field(default=0.4, ge=0, le=1)
    block_s: float = Field(default=8.0, gt=0)
    direction: Vector3 = DOWN
    stiffness_n_m: float = Field(default=300.0, gt=0)
    damping_n_s_m: float = Field(default=2.0, ge=0)
    torque_nm: float = Field(default=0.0, description="twisting couple in step with the motion")
    side_n: float = Field(default=0.0, description="chordwise force in step with the motion")


class Gust(_Section):
    """Vertical gusts on the whole span, on top of a steady airspeed."""

    kind: Literal["gust"]
    at_s: float = Field(ge=0)
    for_s: float = Field(gt=0)
    airspeed_m_s: float = Field(default=10.0, gt=0)
    sigma_m_s: float = Field(default=0.0, ge=0, description="Dryden turbulence")
    length_m: float = Field(default=6.0, gt=0, description="its length scale")
    peak_m_s: float = Field(default=0.0, description="one-minus-cosine gusts, positive lifts")
    gradient_m: float = Field(default=5.0, gt=0, description="their half length")
    every_s: float = Field(default=8.0, gt=0)


Load = Annotated[Force | Sweep | Gust, Field(discriminator="kind")]


class TimedFault(_Section):
    """Something that goes wrong."""

    kind: str
    target: str = Field(default="*", description="'pod 0', 'camera' or '*'")
    at_s: float = Field(ge=0)
    for_s: float = Field(default=1e6, gt=0)
    probability: float = Field(default=1.0, gt=0, le=1)
    value: float = 1.0
    markers: tuple[int, ...] = ()

    @field_validator("kind")
    @classmethod
    def _is_known(cls, value: str) -> str:
        if value not in KINDS:
            msg = f"'{value}' is unknown; wanted one of {', '.join(KINDS)}"
            raise ValueError(msg)
        return value


class ImuQuality(_Section):
    """How good the chips are; see ``bno055_sensing.ImuGrade``."""

    noise_dps_sqrthz: float = Field(default=0.014, ge=0)
    offset_dps: float = Field(default=1.0, ge=0)
    walk_dps_sqrts: float = Field(default=5e-4, ge=0)
    offset_dps_per_k: float = Field(default=0.03, ge=0)
    scale: float = Field(default=0.01, ge=0)
    misalignment_deg: float = Field(default=0.2, ge=0)
    clock_ppm: float = Field(default=40.0, ge=0)
    pod_clock_ppm: float = Field(default=30.0, ge=0, description="one-sigma of a CAN pod's clock")
    i2c_byte_us: float = Field(default=180.0, ge=0, description="time of a byte, stretching incl.")


class FalseLight(_Section):
    """A light that is no marker: standing, or wandering on an ellipse."""

    u_px: float
    v_px: float
    brightness: float = Field(default=1.0, gt=0)
    radius_u_px: float = Field(default=0.0, ge=0)
    radius_v_px: float = Field(default=0.0, ge=0)
    period_s: float = Field(default=20.0, gt=0)
    at_s: float = Field(default=0.0, ge=0)
    for_s: float = Field(default=1e6, gt=0)


class Picture(_Section):
    """What the camera makes of the markers."""

    led_peak: float = Field(default=420.0, gt=0, description="counts at the centre, unclipped")
    led_sigma_px: float = Field(default=1.9, gt=0, description="of the image of a LED at 1 m")
    bloom: float = Field(default=0.05, ge=0, description="of the peak, in a halo")
    bloom_sigma_px: float = Field(default=7.0, gt=0)
    background: float = Field(default=36.0, ge=0)
    texture: float = Field(default=14.0, ge=0)
    read_noise: float = Field(default=1.6, ge=0)
    photons_per_count: float = Field(default=9.0, gt=0)
    lit_bar: float = Field(default=0.0, ge=0, description="counts of the bar between two LEDs")
    flicker: float = Field(default=0.04, ge=0, description="slow change of the illumination")
    delay_s: tuple[float, float] = Field(default=(0.035, 0.150), description="least and most")
    delay_mean_s: float = Field(default=0.055, gt=0)
    drop: float = Field(default=0.004, ge=0, lt=1)
    jitter_s: float = Field(default=2e-4, ge=0, description="one-sigma of the exposure instants")
    time_offset_s: float = Field(default=0.0, description="frames are stamped late by this")
    false_lights: tuple[FalseLight, ...] = ()


class Scenario(_Section):
    """A flight of the simulated wing."""

    name: str
    duration_s: float = Field(default=60.0, gt=0)
    wing: WingProperties = WingProperties()
    root: tuple[Swing, ...] = ()
    loads: tuple[Load, ...] = ()
    faults: tuple[TimedFault, ...] = ()
    imu: ImuQuality = ImuQuality()
    picture: Picture = Picture()
    truth_hz: float = Field(default=100.0, gt=0)


def parse_scenario(tables: dict[str, Any], *, origin: str) -> Scenario:
    """Validate nested tables.

    Raises
    ------
    ConfigError
        Naming ``origin`` and the key.
    """
    try:
        return Scenario.model_validate(tables)
    except ValidationError as error:
        raise ConfigError("\n".join(explain(origin, item) for item in error.errors()[:5])) from None


def packaged_scenarios() -> tuple[str, ...]:
    """Return the names of the packaged scenarios."""
    folder = resources.files("sim_bus.wing").joinpath("scenarios")
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


def load_scenario(name: str | Path) -> Scenario:
    """Return a packaged scenario by its name, or one from a TOML file.

    Raises
    ------
    ConfigError
        If it does not exist, is not TOML, or does not validate.
    """
    try:
        if str(name) in packaged_scenarios():
            file = resources.files("sim_bus.wing").joinpath("scenarios", f"{name}.toml")
            text = file.read_text(encoding="utf-8")
        else:
            text = Path(name).read_text(encoding="utf-8")
        return parse_scenario(tomllib.loads(text), origin=str(name))
    except OSError as error:
        known = ", ".join(packaged_scenarios())
        why = error.strerror
        msg = f"scenario {name}: cannot be read ({why}); give a TOML file or one of {known}"
        raise ConfigError(msg) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        msg = f"scenario {name}: is not valid TOML: {error}"
        raise ConfigError(msg) from error
