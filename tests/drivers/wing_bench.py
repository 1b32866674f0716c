"""One or more simulated chips on a stepped clock, behind each of the three buses."""

from dataclasses import dataclass, field

import can
import numpy as np

from avionics.config.chips import Bno055Settings, Chip
from avionics.config.links import CanLink, I2cLink, Link, SpiLink, UartLink
from avionics.flight.assemble import Mount, imu_sources
from drivers.interfaces import ImuSource
from drivers.samples import ImuSample
from sim_bus.buses.can_pod import SimPod
from sim_bus.buses.factory import SimBuses
from sim_bus.buses.faults import Fault, FaultPlan
from sim_bus.chip.kinds import make_sim_chip
from sim_bus.chip.sensing import PERFECT, ImuGrade
from sim_bus.chip.sim_chip import SimChip
from sim_bus.clock import SimClock

SECOND = 1_000_000_000
START = 5 * SECOND
# Second-order low-pass of 32 Hz: sqrt(2) / (2 pi 32) of delay at low frequency.
LAG_NS = round(1e9 * np.sqrt(2) / (2 * np.pi * 32))
NOISELESS = PERFECT
GOOD = ImuGrade(gyro_offset_dps=0.0, gyro_scale=0.0, misalignment_deg=0.0, gyro_walk_dps_sqrts=0.0)


class Swing:
    """A pendulum about x: 1 Hz, 2 rad/s, and gravity along z."""

    @staticmethod
    def rate(t_ns):
        return 2.0 * np.sin(2 * np.pi * np.asarray(t_ns) * 1e-9)

    def sense(self, t_ns):
        zero = np.zeros(len(t_ns))
        rate = np.stack([self.rate(t_ns), zero, zero - 0.3], axis=1)
        force = np.stack([zero, zero, zero + 9.81], axis=1)
        return rate, force, np.stack([zero + 2e-5, zero, zero + 4e-5], axis=1)

    def attitude(self, t_ns):
        return np.eye(3)


@dataclass
class Bench:
    """A source of IMU samples with its chips, its clock and its faults."""

    clock: SimClock
    chips: list[SimChip]
    imus: ImuSource
    plan: FaultPlan
    pods: list[SimPod] = field(default_factory=list)

    def fly(self, seconds: float) -> list[ImuSample]:
        """Read for so long, a millisecond at a time."""
        samples = []
        end_ns = self.clock.now_ns() + round(seconds * SECOND)
        while self.clock.now_ns() < end_ns:
            sample = self.imus.read(0)
            if sample is None:
                self.clock.advance(1_000_000)
            else:
                samples.append(sample)
        return samples

    def fault(self, kind: str, pod: int, at_s: float, for_s: float, **more) -> None:
        """Let something fail, counted from now."""
        start = self.clock.now_ns() + round(at_s * SECOND)
        self.plan.switch_on(Fault(kind, f"pod {pod}", start, start + round(for_s * SECOND), **more))

    def count(self, name: str) -> int:
        """Sum of a counter over the pods."""
        return sum(group.get(name, 0) for group in self.imus.health().values())


def make_bench(
    bus: str,
    pods: int = 1,
    *,
    chip: Chip | None = None,
    grade: ImuGrade = GOOD,
    faults: list[Fault] | None = None,
    seed: int = 1,
    clock_ppm: float = 0.0,
    local_start_us: int = 0,
    mux: bool = False,
    byte_ns: int = 180_000,
    trigger_hz: float = 0.0,
) -> Bench:
    """Return a bench that is not yet open: what ``assemble`` makes of such links."""
    clock, rng = SimClock(START), np.random.default_rng(seed)
    plan = FaultPlan(list(faults or []), np.random.default_rng(seed + 1))
    wanted = chip or Bno055Settings()
    if trigger_hz:
        wanted = wanted.model_copy(update={"rate_hz": trigger_hz})
    links = [link_of(bus, n, wanted, mux=mux, triggered=trigger_hz > 0) for n in range(pods)]
    mounts = [Mount(str(n), link, wanted) for n, link in enumerate(links)]
    chips = {
        mount.name: make_sim_chip(
            wanted, Swing(), rng, grade=grade, power_on_ns=START, is_booted=True
        )
        for mount in mounts
    }
    buses = SimBuses(clock, plan, chips, byte_ns, is_parallel=False, keeps_calibration=True)

    def make_pod(name: str, node: int, line: can.BusABC) -> SimPod:
        return SimPod(
            node, chips[name], line, clock, target=f"pod {name}", faults=plan,
            clock_ppm=clock_ppm, local_start_us=local_start_us, uid=bytes([node + 1]) * 12,
        )  # fmt: skip

    buses.wire(mounts, make_pod)
    (imus,) = imu_sources(mounts, buses, clock)
    return Bench(clock, list(chips.values()), imus, plan, buses.pods)


def link_of(
    bus: str, number: int, chip: Chip, *, mux: bool = False, triggered: bool = False
) -> Link:
    """Return how one of several pods is connected to a kind of bus."""
    if bus == "can":
        return CanLink(
            kind="can", interface="virtual", channel="bench", node=number, triggered=triggered
        )
    if bus == "uart":
        return UartLink(kind="uart", port=f"/dev/ttyS{number}")
    if bus == "spi":
        return SpiLink(kind="spi", device=number)
    address, *_ = chip.addresses
    if mux:
        return I2cLink(address=address, mux_address=0x70, mux_channel=number)
    return I2cLink(address=address + number)
