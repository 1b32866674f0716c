"""One or more simulated chips on a stepped clock, behind each of the three buses."""

from dataclasses import dataclass, field

import can
import numpy as np

from drivers.bno055.calibration import CalibrationStore
from drivers.bno055.device import Bno055
from drivers.bno055.ports import I2cRegisterPort, Tca9548a, UartRegisterPort
from drivers.bno055.registers import Mode
from drivers.bno055.settings import Settings
from drivers.can.imus import CanImus
from drivers.can.pod.messages import ConfigKey
from drivers.polled_imus import PolledImus
from drivers.samples import ImuSample
from sim_bus.buses.can_pod import SimCanBus, SimPod
from sim_bus.buses.faults import Fault, FaultPlan
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.sensing import PERFECT, ImuGrade
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
    chips: list[SimBno055]
    imus: PolledImus | CanImus
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
    settings: Settings | None = None,
    grade: ImuGrade = GOOD,
    faults: list[Fault] | None = None,
    seed: int = 1,
    clock_ppm: float = 0.0,
    local_start_us: int = 0,
    calibrations: CalibrationStore | None = None,
    mux: bool = False,
    byte_ns: int = 180_000,
    trigger_hz: float = 0.0,
) -> Bench:
    """Return a bench that is not yet open."""
    clock, rng = SimClock(START), np.random.default_rng(seed)
    plan = FaultPlan(list(faults or []), np.random.default_rng(seed + 1))
    chips = [SimBno055(Swing(), rng, grade=grade, power_on_ns=START) for _ in range(pods)]
    wanted = settings or Settings()

    def device(port, number):
        return Bno055(port, clock, pod=str(number), settings=wanted, calibrations=calibrations)

    if bus == "i2c":
        places = [(0x70, n, 0x28) if mux else (None, 0, 0x28 + n) for n in range(pods)]
        wires = {
            p: Wired(chip, f"pod {n}")
            for n, (p, chip) in enumerate(zip(places, chips, strict=True))
        }
        line = SimI2cBus(clock, wires, plan, byte_ns=byte_ns)
        switch = Tca9548a(line, 0x70) if mux else None
        ports = [I2cRegisterPort(line, p[2], mux=switch, channel=p[1]) for p in places]
        imus = PolledImus([device(p, n) for n, p in enumerate(ports)], clock, bus=line)
        return Bench(clock, chips, imus, plan)
    if bus == "uart":
        assert pods == 1
        port = SimSerialPort(chips[0], clock, target="pod 0", faults=plan)
        imus = PolledImus([device(UartRegisterPort(port, clock), 0)], clock, bus=port)
        return Bench(clock, chips, imus, plan)
    assert bus == "can"
    channel = f"bench-{seed}-{id(plan)}"
    cores = [
        SimPod(
            n, chip, SimCanBus(channel, clock), clock, target=f"pod {n}", faults=plan,
            clock_ppm=clock_ppm, local_start_us=local_start_us, uid=bytes([n + 1]) * 12,
        )
        for n, chip in enumerate(chips)
    ]  # fmt: skip
    for core in cores:
        clock.on_advance(core.step)
    asked = {
        ConfigKey.MODE: int(wanted.mode),
        ConfigKey.GYRO_RANGE_DPS: wanted.gyro_range_dps,
        ConfigKey.GYRO_BANDWIDTH_HZ: wanted.gyro_bandwidth_hz,
        ConfigKey.STREAMS: 3 if wanted.mode is Mode.AMG else 0,
    }
    if wanted.mode.is_fusion:
        del asked[ConfigKey.GYRO_RANGE_DPS], asked[ConfigKey.GYRO_BANDWIDTH_HZ]
    receiver: can.BusABC = SimCanBus(channel, clock)
    names = {n: str(n) for n in range(pods)}
    each = dict.fromkeys(range(pods), asked)
    imus = CanImus(receiver, names, clock, settings=each, trigger_hz=trigger_hz)
    return Bench(clock, chips, imus, plan, cores)
