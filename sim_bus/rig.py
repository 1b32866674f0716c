"""``open_sim_rig``: the real drivers on simulated buses, the camera and the truth, one clock."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from avionics.config import FlightConfig
from avionics.config.links import I2cLink
from avionics.flight.rig import Rig
from avionics.records import Truth
from drivers.clock import Clock
from sim_bus.buses.can_pod import SimPod
from sim_bus.buses.factory import (
    Opener,
    Parts,
    can_sources,
    generator,
    i2c_sources,
    root_source,
    uart_sources,
)
from sim_bus.buses.faults import Fault, FaultPlan, seconds_to_ns
from sim_bus.camera.sim_camera import SimCamera
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.sensing import ImuGrade
from sim_bus.clock import SimClock
from sim_bus.realtime import PacedClock
from sim_bus.wing.build import make_wing
from sim_bus.wing.motion import PodMotion, RootSensor
from sim_bus.wing.scenario import ImuQuality, Scenario
from sim_bus.wing.sim_wing import SimWing

# Chips and pods boot, drivers open and pod clocks are learnt while the wing rests.
EPOCH_NS = 5_000_000_000
WARM_UP_STEP_NS = 1_000_000


class SimTruth:
    """The wings' true shapes, one after the other, at a fixed rate; a ``Source[Truth]``."""

    def __init__(self, wings: Sequence[SimWing], clock: Clock, rate_hz: float) -> None:
        self._wings, self._clock = wings, clock
        self._period_ns = round(1e9 / rate_hz)
        self._due_ns = wings[0].epoch_ns
        self._next = 0
        self._is_open = True

    def read(self, timeout_s: float) -> Truth | None:
        """Return the next shape, None if none is due within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        if not self._is_open or self._due_ns > deadline_ns:
            if timeout_s > 0:
                self._clock.sleep_until_ns(deadline_ns)
            return None
        self._clock.sleep_until_ns(self._due_ns)
        truth = self._wings[self._next].truth(self._due_ns)
        self._next = (self._next + 1) % len(self._wings)
        if self._next == 0:
            self._due_ns += self._period_ns
        return truth

    def close(self) -> None:
        """Stop; may be called twice."""
        self._is_open = False


@dataclass(slots=True)
class SimRig(Rig):
    """A rig of simulated parts.

    Attributes
    ----------
    wings : tuple of SimWing
        The truth behind it, one wing or several.
    faults : FaultPlan
        What goes wrong; faults can be switched on while it flies.
    chips : dict of str to SimBno055
        The chip of every pod, by its identifier; "root" is the root's own.
    pods : list of SimPod
        The pods on CAN.
    """

    wings: tuple[SimWing, ...] = field(kw_only=True)
    faults: FaultPlan = field(kw_only=True)
    chips: dict[str, SimBno055] = field(default_factory=dict)
    pods: list[SimPod] = field(default_factory=list)

    @property
    def wing(self) -> SimWing:
        """The first wing, whose root is that of all."""
        return self.wings[0]

    def close(self) -> None:
        """Close every source and every simulated part; may be called twice."""
        if isinstance(self.clock, PacedClock):
            self.clock.close()
        for source in (*self.imus, *self.cameras, *([self.truth] if self.truth else [])):
            source.close()
        pods, self.pods = self.pods, []
        for pod in pods:
            pod.close()


def make_faults(scenario: Scenario, epoch_ns: int, rng: np.random.Generator) -> FaultPlan:
    """Return a scenario's faults on the rig's clock."""
    return FaultPlan(
        [
            Fault(
                f.kind,
                f.target,
                epoch_ns + seconds_to_ns(f.at_s),
                epoch_ns + seconds_to_ns(f.at_s + f.for_s),
                f.probability,
                f.value,
                f.markers,
            )
            for f in scenario.faults
        ],
        rng,
    )


def part_name(part: str, name: str, config: FlightConfig) -> str:
    """Return what one of several parts is called in the fault plan and for its random draws.

    Where only one wing flies, its name does not matter.
    """
    return part if len(config.wing_configs) == 1 else f"{part} {name}"


def imu_grade(quality: ImuQuality) -> ImuGrade:
    """Return the grade of chip that a scenario asks for."""
    return ImuGrade(
        gyro_noise_dps_sqrthz=quality.noise_dps_sqrthz,
        gyro_offset_dps=quality.offset_dps,
        gyro_walk_dps_sqrts=quality.walk_dps_sqrts,
        gyro_offset_dps_per_k=quality.offset_dps_per_k,
        gyro_scale=quality.scale,
        misalignment_deg=quality.misalignment_deg,
        clock_ppm=quality.clock_ppm,
    )


def open_sim_rig(
    config: FlightConfig, scenario: Scenario, *, seed: int = 0, realtime: bool = False
) -> SimRig:
    """Return the simulated wings behind the real drivers, opened and at time zero.

    Parameters
    ----------
    config : Config or WingsConfig
        What flies. Every pod's ``link`` decides the bus its chip is behind; a pod without one
        sits on I2C. The configured cameras are the true ones.
    scenario : Scenario
        What happens: to all wings the same, save the turbulence and what is random; their one
        root moves them all.
    seed : int
        Of every random draw; the same seed gives the same flight.
    realtime : bool
        Whether the clock is the machine's own; otherwise it moves on command.

    Raises
    ------
    ConfigError
        If two pods share one address.
    DriverError
        If a simulated chip does not come up, or a CAN pod has no C compiler to be built with.
    """
    clock: SimClock | PacedClock = PacedClock() if realtime else SimClock()
    epoch_ns = clock.now_ns() + EPOCH_NS
    faults = make_faults(scenario, epoch_ns, generator(seed, "faults"))
    wings = tuple(
        make_wing(
            each,
            scenario,
            rng=generator(seed, part_name("wing", each.wing.name, config)),
            epoch_ns=epoch_ns,
        )
        for each in config.wing_configs
    )
    rig = SimRig(clock, wings=wings, faults=faults)
    try:
        _open(rig, clock, config, scenario, seed)
        _warm_up(rig, clock)
        for each, wing in zip(config.wing_configs, wings, strict=True):
            if each.camera is not None:
                target = part_name("camera", each.camera.name, config)
                camera = SimCamera(
                    each.camera, wing, each.markers, clock, look=scenario.picture,
                    rng=generator(seed, target), faults=faults, target=target,
                    start_ns=wing.epoch_ns + round(0.5e9 / each.camera.fps),
                )  # fmt: skip
                rig.cameras.append(camera)
        rig.truth = SimTruth(wings, clock, scenario.truth_hz)
    except BaseException:
        rig.close()
        raise
    return rig


def _open(
    rig: SimRig, clock: SimClock | PacedClock, config: FlightConfig, scenario: Scenario, seed: int
) -> None:
    grade, now_ns = imu_grade(scenario.imu), clock.now_ns()
    for wing, each in zip(rig.wings, config.wing_configs, strict=True):
        for pod in each.pods:
            rng = generator(seed, f"pod {pod.name}")
            rig.chips[pod.name] = SimBno055(
                PodMotion(wing, pod), rng, grade=grade, power_on_ns=now_ns, is_booted=False
            )
    links = {pod.name: pod.link or I2cLink(bus=100 + pod.id) for pod in config.pods}
    openers: list[Opener] = []
    parts = Parts(clock, rig.faults, rig.chips, rig.pods)
    byte_ns = round(scenario.imu.i2c_byte_us * 1e3)
    if scenario.root:  # a root that moves has an IMU of its own
        rng = generator(seed, "root")
        rig.chips["root"] = SimBno055(
            RootSensor(rig.wing), rng, grade=grade, power_on_ns=now_ns, is_booted=False
        )
        source, opener = root_source(parts, rig.chips["root"], byte_ns=byte_ns)
        rig.imus.append(source)
        openers.append(opener)
    for source, opener in (
        *i2c_sources(parts, config, links, byte_ns=byte_ns),
        *uart_sources(parts, config, links),
        *can_sources(parts, config, links, scenario.imu, seed),
    ):
        rig.imus.append(source)
        openers.append(opener)
    for sim_pod in rig.pods:
        clock.on_advance(sim_pod.step)
    for opener in openers:
        opener()


def _warm_up(rig: SimRig, clock: SimClock | PacedClock) -> None:
    """Let the sources run until time zero and throw away what they read."""
    while clock.now_ns() < rig.wing.epoch_ns:
        clock.sleep_until_ns(min(clock.now_ns() + WARM_UP_STEP_NS, rig.wing.epoch_ns))
        for source in rig.imus:
            while source.read(0) is not None:
                pass
