"""The real IMU sources on simulated buses, as every pod's ``link`` asks."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from avionics.config import FlightConfig, Pod
from avionics.config.links import CanLink, I2cLink, Link, UartLink
from avionics.errors import ConfigError
from avionics.flight.chips import make_chip, pod_settings
from drivers.bno055.device import Bno055
from drivers.bno055.ports import I2cRegisterPort, Tca9548a, UartRegisterPort
from drivers.bno055.settings import Settings
from drivers.can.imus import CanImus
from drivers.can.python_can import PythonCanPort
from drivers.clock import Clock
from drivers.interfaces import ImuChip, Source
from drivers.polled_imus import PolledImus
from drivers.register_port import RegisterPort
from drivers.samples import ImuSample
from sim_bus.buses.can_pod import SimCanBus, SimPod
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import Place, SimI2cBus, Wired
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.clock import SimClock
from sim_bus.timeline import ParallelImus, Timeline
from sim_bus.wing.scenario import ImuQuality

Opener = Callable[[], None]
Links = Mapping[str, Link]
Opened = list[tuple[Source[ImuSample], Opener]]


@dataclass(slots=True)
class Parts:
    """What the buses are made of.

    Attributes
    ----------
    clock : Clock
        The rig's clock.
    faults : FaultPlan
        What goes wrong.
    chips : dict of str to SimBno055
        The chip of every pod, by its identifier.
    pods : list of SimPod
        The pods on CAN, once made.
    """

    clock: Clock
    faults: FaultPlan
    chips: dict[str, SimBno055] = field(default_factory=dict)
    pods: list[SimPod] = field(default_factory=list)

    def polling_clock(self) -> Clock:
        """Return the clock of one more polled bus: its own time line where time is stepped."""
        is_stepped = isinstance(self.clock, SimClock)
        return Timeline(self.clock.now_ns()) if is_stepped else self.clock


def generator(seed: int, name: str) -> np.random.Generator:
    """Return the random generator of one part: parts do not disturb each other's draws."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def _polled(
    devices: Sequence[ImuChip],
    rate_hz: float,
    bus: SimI2cBus | SimSerialPort,
    clock: Clock,
    rig_clock: Clock,
) -> tuple[Source[ImuSample], Opener]:
    source = PolledImus(devices, clock, rate_hz, bus=bus)
    if isinstance(clock, Timeline):
        parallel = ParallelImus(source, clock, rig_clock)
        return parallel, parallel.open
    return source, source.open


def _device(port: RegisterPort, clock: Clock, pod: Pod) -> ImuChip:
    return make_chip(pod, port, clock, keeps_calibration=False)


def i2c_sources(parts: Parts, config: FlightConfig, links: Links, *, byte_ns: int) -> Opened:
    """Return one source per I2C bus and what opens it."""
    buses: dict[int, list[tuple[Pod, I2cLink]]] = {}
    for pod in config.pods:
        link = links[pod.name]
        if isinstance(link, I2cLink):
            buses.setdefault(link.bus, []).append((pod, link))
    opened: Opened = []
    for number, members in sorted(buses.items()):
        chips: dict[Place, Wired] = {}
        for pod, link in members:
            place = (link.mux_address, link.mux_channel, link.address)
            if place in chips:
                msg = f"pod {pod.name}: address 0x{link.address:02X} on I2C bus {number} is taken"
                raise ConfigError(msg)
            chips[place] = Wired(parts.chips[pod.name], f"pod {pod.name}")
        clock = parts.polling_clock()
        bus = SimI2cBus(clock, chips, parts.faults, byte_ns=byte_ns)
        addresses = sorted({m.mux_address for _, m in members if m.mux_address is not None})
        muxes = {address: Tca9548a(bus, address) for address in addresses}
        devices = [
            _device(
                I2cRegisterPort(
                    bus,
                    link.address,
                    mux=None if link.mux_address is None else muxes[link.mux_address],
                    channel=link.mux_channel,
                ),
                clock,
                pod,
            )
            for pod, link in members
        ]
        opened.append(_polled(devices, members[0][0].chip.rate_hz, bus, clock, parts.clock))
    return opened


def root_source(parts: Parts, chip: SimBno055, *, byte_ns: int) -> tuple[Source[ImuSample], Opener]:
    """Return the root's own IMU, on an I2C bus by itself, and what opens it."""
    clock = parts.polling_clock()
    bus = SimI2cBus(clock, {(None, 0, 0x28): Wired(chip, "root")}, parts.faults, byte_ns=byte_ns)
    device = Bno055(I2cRegisterPort(bus, 0x28), clock, pod="root", settings=Settings())
    return _polled([device], 100.0, bus, clock, parts.clock)


def uart_sources(parts: Parts, config: FlightConfig, links: Links) -> Opened:
    """Return one source per serial line and what opens it."""
    opened: Opened = []
    for pod in config.pods:
        link = links[pod.name]
        if isinstance(link, UartLink):
            clock = parts.polling_clock()
            port = SimSerialPort(
                parts.chips[pod.name], clock, target=f"pod {pod.name}", faults=parts.faults,
                baud=link.baud,
            )  # fmt: skip
            device = _device(UartRegisterPort(port, clock), clock, pod)
            opened.append(_polled([device], pod.chip.rate_hz, port, clock, parts.clock))
    return opened


def can_sources(
    parts: Parts, config: FlightConfig, links: Links, quality: ImuQuality, seed: int
) -> Opened:
    """Make the pods; return one source per CAN channel and what opens it."""
    buses: dict[str, list[tuple[Pod, CanLink]]] = {}
    for pod in config.pods:
        link = links[pod.name]
        if isinstance(link, CanLink):
            buses.setdefault(link.channel, []).append((pod, link))
    opened: Opened = []
    for name, members in sorted(buses.items()):
        nodes = [link.node for _, link in members]
        if len(set(nodes)) != len(nodes):
            msg = f"CAN channel {name}: node numbers {nodes} are not unique"
            raise ConfigError(msg)
        # Rigs of one process must not hear each other.
        channel = f"{name} of rig {id(parts)}"
        bus = SimCanBus(channel, parts.clock)
        for pod, link in members:
            rng = generator(seed, f"microcontroller {pod.name}")
            sim_pod = SimPod(
                link.node, parts.chips[pod.name], SimCanBus(channel, parts.clock), parts.clock,
                target=f"pod {pod.name}", faults=parts.faults,
                clock_ppm=float(quality.pod_clock_ppm * rng.standard_normal()),
                local_start_us=int(rng.integers(0, 1 << 31)),
                uid=bytes(rng.integers(0, 256, 12, dtype=np.uint8)),
            )  # fmt: skip
            parts.pods.append(sim_pod)
        source = CanImus(
            PythonCanPort(bus, parts.clock, name=f"can {name}"),
            {link.node: pod.name for pod, link in members},
            parts.clock,
            settings={link.node: pod_settings(pod) for pod, link in members},
            trigger_hz=max(pod.chip.rate_hz * link.triggered for pod, link in members),
        )
        opened.append((source, source.open))
    return opened
