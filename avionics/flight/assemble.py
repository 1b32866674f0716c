"""From the links of a configuration to a rig, over a factory that opens the buses.

Hardware, simulation, bench and tests differ in the factory only.
"""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from avionics.config import Camera, FlightConfig, Pod, RootImu
from avionics.config.chips import Chip
from avionics.config.links import CanLink, I2cLink, Link, SpiLink, UartLink
from avionics.flight.chips import make_chip, pod_settings
from avionics.flight.rig import Rig
from drivers.bno055.ports import UartRegisterPort
from drivers.can.imus import CanImus
from drivers.can.port import CanPort
from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from drivers.i2c_registers import I2cRegisterPort
from drivers.icm42688.spi_port import SpiRegisterPort
from drivers.interfaces import I2cBus, ImuChip, ImuSource, SerialPort, Source, SpiDevice
from drivers.polled_imus import PolledImus
from drivers.register_port import RegisterPort
from drivers.samples import Frame
from drivers.tca9548a import Muxes

L = TypeVar("L", I2cLink, SpiLink, UartLink, CanLink)


class Buses(Protocol):
    """Opens what links and cameras name."""

    @property
    def keeps_calibration(self) -> bool:
        """Whether the calibration files of chips are read and written."""
        ...

    def link(self, pod: Pod | RootImu) -> Link:
        """Return how a pod, or the IMU at the root, is connected.

        Raises
        ------
        ConfigError
            If it is not.
        """
        ...

    def polling_clock(self) -> Clock:
        """Return the clock of whoever reads one more polled bus."""
        ...

    def i2c(self, number: int, clock: Clock) -> I2cBus:
        """Open an I2C bus that is read on ``clock``.

        Raises
        ------
        DeviceNotFoundError
            If it does not open; the message names the remedy. So do the other buses.
        """
        ...

    def spi(self, link: SpiLink, clock: Clock) -> SpiDevice:
        """Open a chip select of an SPI bus that is read on ``clock``."""
        ...

    def serial(self, port: str, baud: int, clock: Clock) -> SerialPort:
        """Open a serial line that is read on ``clock``."""
        ...

    def can(self, interface: str, channel: str, bitrate: int | None) -> CanPort:
        """Open a CAN bus."""
        ...

    def polled(self, imus: PolledImus, clock: Clock) -> ImuSource:
        """Return the source as a rig reads it, beside others that wait for their own buses."""
        ...

    def camera(self, camera: Camera) -> Source[Frame] | None:
        """Open a camera; None where it has no pictures to give."""
        ...


@dataclass(frozen=True, slots=True)
class Mount:
    """One IMU and how it is reached.

    Attributes
    ----------
    name : str
        The pod's identifier, or ``"root"``.
    link : Link
        The bus and the place on it.
    chip : Bno055Settings or Icm42688Settings
        Which one it is, and its settings.
    """

    name: str
    link: Link
    chip: Chip


def assemble(config: FlightConfig, buses: Buses, clock: Clock, *, root: Mount | None = None) -> Rig:
    """Open everything that a configuration names and wait until it delivers.

    Parameters
    ----------
    config : Config or WingsConfig
        What flies.
    buses : Buses
        Opens it.
    clock : Clock
        The one clock of all samples.
    root : Mount, optional
        The IMU at the root, instead of the configuration's.

    Raises
    ------
    ConfigError
        If a pod has no link.
    DeviceNotFoundError
        If a device is missing, is not what it should be, or is one with another; the message
        names it and the remedy.
    DriverError
        If a device fails while it is set.
    """
    rig = Rig(clock)
    try:
        # The cameras first: they take seconds, in which the buses would fill with unread frames.
        for camera in config.cameras:
            pictures = buses.camera(camera)
            if pictures is not None:
                rig.cameras.append(pictures)
        if root is None and config.root is not None:
            (root,) = mounts_of([config.root], buses)
        mounts = [*([] if root is None else [root]), *mounts_of(config.pods, buses)]
        ids: dict[str, bytes] = {}
        for source in imu_sources(mounts, buses, clock):
            rig.imus.append(source)
            source.open()
            ids |= source.chip_ids()
            check_chip_ids(ids)
    except BaseException:
        rig.close()
        raise
    return rig


def mounts_of(pods: Iterable[Pod | RootImu], buses: Buses) -> list[Mount]:
    """Return the IMUs of pods, each with its link."""
    return [Mount(pod.name, buses.link(pod), pod.chip) for pod in pods]


def imu_sources(
    mounts: Sequence[Mount], buses: Buses, clock: Clock, *, only: str | None = None
) -> Iterator[ImuSource]:
    """Open one bus after the other; yields the source of each, whose IMUs are not yet set.

    Parameters
    ----------
    mounts : sequence of Mount
        All IMUs; their links do not contradict each other.
    buses : Buses
        Opens the buses.
    clock : Clock
        The clock of the samples.
    only : str, optional
        The one IMU that is wanted, of all that are connected.
    """

    def wanted(members: list[tuple[Mount, L]]) -> list[tuple[Mount, L]]:
        return [member for member in members if only in (None, member[0].name)]

    for number, on_bus in _grouped(mounts, I2cLink, lambda link: link.bus).items():
        if members := wanted(on_bus):
            yield _i2c(number, members, [link for _, link in on_bus], buses)
    for (at, device), on_select in _grouped(mounts, SpiLink, lambda x: (x.bus, x.device)).items():
        if wanted(on_select):
            yield _spi(f"spi {at}.{device}", *on_select[0], buses)
    for (port, baud), on_line in _grouped(mounts, UartLink, lambda x: (x.port, x.baud)).items():
        if wanted(on_line):
            yield _uart(port, baud, on_line[0][0], buses)
    for _, on_channel in _grouped(mounts, CanLink, lambda x: (x.interface, x.channel)).items():
        if nodes := wanted(on_channel):
            yield _can(nodes, buses, clock)


def check_chip_ids(ids: Mapping[str, bytes]) -> None:
    """Raise where two IMUs answer with the unique id of one chip.

    Parameters
    ----------
    ids : mapping of str to bytes
        Unique id by what messages call the IMU; chips without one give no bytes.

    Raises
    ------
    DeviceNotFoundError
        Naming both, the id and where to look.
    """
    owners: dict[bytes, str] = {}
    for name, uid in ids.items():
        if not any(uid) or uid == b"\xff" * len(uid):  # none, or never written
            continue
        other = owners.setdefault(uid, name)
        if other != name:
            msg = (
                f"{other} and {name}: both answer as the chip {uid.hex()}; one chip is reached "
                "over two links: check the wiring, the addresses and the channels of the "
                "multiplexers, and whether two buses or ports are one"
            )
            raise DeviceNotFoundError(msg)


K = TypeVar("K", bound=Hashable)


def _grouped(
    mounts: Sequence[Mount], kind: type[L], key: Callable[[L], K]
) -> dict[K, list[tuple[Mount, L]]]:
    groups: dict[K, list[tuple[Mount, L]]] = defaultdict(list)
    for mount in mounts:
        if isinstance(mount.link, kind):
            groups[key(mount.link)].append((mount, mount.link))
    return groups


def _i2c(
    number: int, members: list[tuple[Mount, I2cLink]], links: list[I2cLink], buses: Buses
) -> ImuSource:
    clock = buses.polling_clock()
    bus = buses.i2c(number, clock)
    muxes = Muxes(bus, [link.mux_address for link in links if link.mux_address is not None])
    chips = []
    for mount, link in members:
        behind = None
        if link.mux_address is not None:
            behind = muxes.channel(link.mux_address, link.mux_channel)
        port = I2cRegisterPort(bus, link.address, behind=behind)
        chips.append(_chip(mount, port, clock, buses))
    rate_hz = members[0][0].chip.rate_hz
    imus = PolledImus(chips, clock, rate_hz, bus=bus, name=f"i2c bus {number}")
    return buses.polled(imus, clock)


def _spi(name: str, mount: Mount, link: SpiLink, buses: Buses) -> ImuSource:
    clock = buses.polling_clock()
    device = buses.spi(link, clock)
    chip = _chip(mount, SpiRegisterPort(device), clock, buses)
    imus = PolledImus([chip], clock, mount.chip.rate_hz, bus=device, name=name)
    return buses.polled(imus, clock)


def _chip(mount: Mount, port: RegisterPort, clock: Clock, buses: Buses) -> ImuChip:
    keeps = buses.keeps_calibration
    return make_chip(mount.chip, mount.name, port, clock, keeps_calibration=keeps)


def _uart(port: str, baud: int, mount: Mount, buses: Buses) -> ImuSource:
    clock = buses.polling_clock()
    line = buses.serial(port, baud, clock)
    chip = _chip(mount, UartRegisterPort(line, clock), clock, buses)
    imus = PolledImus([chip], clock, mount.chip.rate_hz, bus=line, name=f"uart {port}")
    return buses.polled(imus, clock)


def _can(members: list[tuple[Mount, CanLink]], buses: Buses, clock: Clock) -> ImuSource:
    first, link = members[0]
    return CanImus(
        buses.can(link.interface, link.channel, link.bitrate),
        {link.node: mount.name for mount, link in members},
        clock,
        settings={link.node: pod_settings(mount.chip) for mount, link in members},
        trigger_hz=first.chip.rate_hz if link.triggered else 0.0,
    )
