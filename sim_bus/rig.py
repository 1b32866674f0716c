"""``open_sim_rig``: the real drivers on simulated buses, the camera and the truth, one clock."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from avionics.config import Camera, FlightConfig, RootImu
from avionics.config.chips import Chip
from avionics.config.link_checks import check_links
from avionics.flight.assemble import Mount, assemble, mounts_of
from avionics.flight.rig import Rig
from avionics.records import ROOT, Truth
from drivers.clock import Clock
from sim_bus.buses.can_pod import SimPod
from sim_bus.buses.factory import DrawnPods, SimBuses, generator
from sim_bus.buses.faults import Fault, FaultPlan, seconds_to_ns
from sim_bus.camera.sim_camera import SimCamera
from sim_bus.chip.kinds import make_sim_chip
from sim_bus.chip.sensing import ImuGrade, Motion
from sim_bus.chip.sim_chip import SimChip
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
    chips : dict of str to SimChip
        The chip of every pod, by its identifier; "root" is the root's own.
    pods : list of SimPod
        The pods on CAN.
    """

    wings: tuple[SimWing, ...] = field(kw_only=True)
    faults: FaultPlan = field(kw_only=True)
    chips: dict[str, SimChip] = field(default_factory=dict)
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
        If a pod without a link meets one that has.
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
        rig.truth = SimTruth(wings, clock, scenario.truth_hz)
    except BaseException:
        rig.close()
        raise
    return rig


def _open(
    rig: SimRig, clock: SimClock | PacedClock, config: FlightConfig, scenario: Scenario, seed: int
) -> None:
    """Wire the chips as the links say and open the rig as it is opened on hardware."""
    grade, now_ns = imu_grade(scenario.imu), clock.now_ns()
    flown = list(zip(rig.wings, config.wing_configs, strict=True))

    def chip_of(chip: Chip, motion: Motion, name: str) -> SimChip:
        rng = generator(seed, name)
        return make_sim_chip(chip, motion, rng, grade=grade, power_on_ns=now_ns)

    def open_camera(camera: Camera) -> SimCamera:
        wing, each = next(pair for pair in flown if pair[1].camera == camera)
        target = part_name("camera", camera.name, config)
        return SimCamera(
            camera, wing, each.markers, clock, look=scenario.picture,
            rng=generator(seed, target), faults=rig.faults, target=target,
            start_ns=wing.epoch_ns + round(0.5e9 / camera.fps),
        )  # fmt: skip

    byte_ns = round(scenario.imu.i2c_byte_us * 1e3)
    buses = SimBuses(clock, rig.faults, rig.chips, byte_ns, open_camera=open_camera, pods=rig.pods)
    for wing, each in flown:
        for pod in each.pods:
            rig.chips[pod.name] = chip_of(pod.chip, PodMotion(wing, pod), f"pod {pod.name}")
    mounts: list[Mount] = mounts_of(config.pods, buses)
    root: Mount | None = None
    if scenario.root or config.root:  # a root that moves has an IMU of its own
        imu = config.root or RootImu()
        (root,) = mounts_of([imu], buses)
        rig.chips[ROOT] = chip_of(imu.chip, RootSensor(rig.wing, imu), ROOT)
        mounts.append(root)
    check_links(mounts)
    buses.wire(mounts, DrawnPods(clock, rig.faults, rig.chips, scenario.imu, seed))
    opened = assemble(config, buses, clock, root=root)
    rig.imus, rig.cameras = opened.imus, opened.cameras


def _warm_up(rig: SimRig, clock: SimClock | PacedClock) -> None:
    """Let the sources run until time zero and throw away what they read."""
    while clock.now_ns() < rig.wing.epoch_ns:
        clock.sleep_until_ns(min(clock.now_ns() + WARM_UP_STEP_NS, rig.wing.epoch_ns))
        for source in rig.imus:
            while source.read(0) is not None:
                pass
