"""Simulated chips and pods on simulated buses, wired as links say: a factory for ``assemble``."""

import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import can
import numpy as np

from avionics.config import Camera, Pod, RootImu
from avionics.config.links import CanLink, I2cLink, Link, SpiLink, UartLink
from avionics.flight.assemble import Mount
from avionics.records import ROOT
from drivers.can.port import CanPort
from drivers.can.python_can import PythonCanPort
from drivers.clock import Clock
from drivers.interfaces import I2cBus, ImuSource, SerialPort, Source, SpiDevice
from drivers.polled_imus import PolledImus
from drivers.samples import Frame
from sim_bus.buses.can_pod import PodBus, SimCanBus, SimPod
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import Place, SimI2cBus, Wired
from sim_bus.buses.spi import SimSpiDevice
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.icm42688.chip import SimIcm42688
from sim_bus.chip.sim_chip import SimChip
from sim_bus.clock import SimClock
from sim_bus.realtime import PacedClock
from sim_bus.timeline import ParallelImus, Timeline
from sim_bus.wing.scenario import ImuQuality

# Buses of pods whose link is not configured.
FIRST_BUS = 100
ROOT_BUS = 99


def generator(seed: int, name: str) -> np.random.Generator:
    """Return the random generator of one part: parts do not disturb each other's draws."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def target_of(name: str) -> str:
    """Return under which name faults find the IMU of a mount."""
    return name if name == ROOT else f"pod {name}"


def bno055(chip: SimChip) -> SimBno055:
    """Return the chip as what alone can be on a serial line or a pod."""
    assert isinstance(chip, SimBno055)  # the configuration allows no other there
    return chip


def no_camera(camera: Camera) -> Source[Frame] | None:
    """Return None: a rig of IMUs alone."""
    return None


@dataclass(frozen=True, slots=True)
class DrawnPods:
    """Makes pods whose microcontrollers differ as a scenario lets them.

    Attributes
    ----------
    clock : Clock
        The rig's clock.
    faults : FaultPlan
        What goes wrong.
    chips : mapping of str to SimChip
        The chip of every pod, by its identifier.
    quality : ImuQuality
        How far the clocks of the pods are off.
    seed : int
        Of every draw.
    """

    clock: Clock
    faults: FaultPlan
    chips: Mapping[str, SimChip]
    quality: ImuQuality
    seed: int

    def __call__(self, name: str, node: int, bus: PodBus) -> SimPod:
        """Return one pod on a bus."""
        rng = generator(self.seed, f"microcontroller {name}")
        return SimPod(
            node, bno055(self.chips[name]), bus, self.clock,
            target=target_of(name), faults=self.faults,
            clock_ppm=float(self.quality.pod_clock_ppm * rng.standard_normal()),
            local_start_us=int(rng.integers(0, 1 << 31)),
            uid=bytes(rng.integers(0, 256, 12, dtype=np.uint8)),
        )  # fmt: skip


@dataclass(slots=True)
class SimBuses:
    """Simulated chips behind the interfaces that the drivers use; a ``Buses``.

    Attributes
    ----------
    clock : SimClock or PacedClock
        The rig's clock.
    faults : FaultPlan
        What goes wrong.
    chips : mapping of str to SimChip
        The chip of every pod, by its identifier.
    byte_ns : int
        Time of one byte on I2C, ns.
    is_parallel : bool
        Whether every polled bus has its own time where time is stepped, as it has its own thread
        on hardware.
    keeps_calibration : bool
        Whether the simulated chips' calibrations are kept in the configured files.
    open_camera : callable
        Opens a camera.
    pods : list of SimPod
        The pods on CAN.
    """

    clock: SimClock | PacedClock
    faults: FaultPlan
    chips: Mapping[str, SimChip]
    byte_ns: int
    is_parallel: bool = True
    keeps_calibration: bool = False
    open_camera: Callable[[Camera], Source[Frame] | None] = no_camera
    pods: list[SimPod] = field(default_factory=list)
    _i2c: dict[int, dict[Place, Wired]] = field(default_factory=dict)
    _selects: dict[tuple[int, int], str] = field(default_factory=dict)
    _lines: dict[str, str] = field(default_factory=dict)

    def wire(
        self, mounts: Iterable[Mount], make_pod: Callable[[str, int, can.BusABC], SimPod]
    ) -> None:
        """Put every chip where its link says; pods on CAN begin to live.

        Parameters
        ----------
        mounts : iterable of Mount
            All that is connected.
        make_pod : callable
            Makes the pod of a name and a node number on a bus.
        """
        for mount in mounts:
            name = mount.name
            match mount.link:
                case I2cLink() as link:
                    places = self._i2c.setdefault(link.bus, {})
                    place = (link.mux_address, link.mux_channel, link.address)
                    places[place] = Wired(self.chips[name], target_of(name))
                case SpiLink() as link:
                    self._selects[link.bus, link.device] = name
                case UartLink() as link:
                    self._lines[link.port] = name
                case CanLink() as link:
                    bus = SimCanBus(self._channel(link.interface, link.channel), self.clock)
                    pod = make_pod(name, link.node, bus)
                    self.pods.append(pod)
                    self.clock.on_advance(pod.step)

    def link(self, pod: Pod | RootImu) -> Link:
        """Return how a pod is connected; one that is not has an I2C bus of its own."""
        bus = FIRST_BUS + pod.id if isinstance(pod, Pod) else ROOT_BUS
        return pod.link or I2cLink(bus=bus, address=pod.chip.addresses[0])

    def polling_clock(self) -> Clock:
        """Return the clock of one more polled bus."""
        is_stepped = isinstance(self.clock, SimClock)
        return Timeline(self.clock.now_ns()) if is_stepped and self.is_parallel else self.clock

    def i2c(self, number: int, clock: Clock) -> I2cBus:
        """Return the simulated bus with its chips."""
        return SimI2cBus(clock, self._i2c[number], self.faults, byte_ns=self.byte_ns)

    def spi(self, link: SpiLink, clock: Clock) -> SpiDevice:
        """Return the simulated chip select with its chip."""
        name = self._selects[link.bus, link.device]
        chip = self.chips[name]
        assert isinstance(chip, SimIcm42688)  # the configuration allows no other there
        return SimSpiDevice(
            chip, clock, target=target_of(name), faults=self.faults, speed_hz=link.speed_hz
        )

    def serial(self, port: str, baud: int, clock: Clock) -> SerialPort:
        """Return the simulated line with its chip."""
        name = self._lines[port]
        return SimSerialPort(
            bno055(self.chips[name]), clock, target=target_of(name), faults=self.faults, baud=baud
        )

    def can(self, interface: str, channel: str, bitrate: int | None) -> CanPort:
        """Return a port on the channel that the pods are on."""
        bus = SimCanBus(self._channel(interface, channel), self.clock)
        return PythonCanPort(bus, self.clock, name=f"can {channel}")

    def polled(self, imus: PolledImus, clock: Clock) -> ImuSource:
        """Return the source as if it ran in its own thread."""
        return ParallelImus(imus, clock, self.clock) if isinstance(clock, Timeline) else imus

    def camera(self, camera: Camera) -> Source[Frame] | None:
        """Open a camera."""
        return self.open_camera(camera)

    def _channel(self, interface: str, channel: str) -> str:
        """Rigs of one process must not hear each other."""
        return f"{interface} {channel} of rig {id(self)}"
