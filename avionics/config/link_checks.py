"""Links checked against each other: what no bus could serve is refused before anything is opened.

Two chips of one address behind two multiplexers, or two channels of one, are fine: the driver
closes all multiplexers of a bus but the one it needs.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Protocol, TypeVar

from avionics.config.chips import Chip
from avionics.config.links import CanLink, I2cLink, Link, SpiLink, UartLink
from avionics.errors import ConfigError
from drivers.can.pod.messages import RATE_MAX_HZ


class Linked(Protocol):
    """A pod, or another IMU, with its link and its settings."""

    @property
    def name(self) -> str:
        """Identifier of the pod."""
        ...

    @property
    def link(self) -> Link | None:
        """How it is connected."""
        ...

    @property
    def chip(self) -> Chip:
        """What it is set to."""
        ...


L = TypeVar("L", I2cLink, SpiLink, UartLink, CanLink)
Members = Sequence[tuple[Linked, L]]


def check_links(pods: Iterable[Linked]) -> None:
    """Raise where links contradict each other.

    Parameters
    ----------
    pods : iterable of Linked
        All that fly; those without a link are passed over.

    Raises
    ------
    ConfigError
        Naming the pods, the keys and the remedy.
    """
    linked = list(pods)
    for bus, on_bus in _grouped(linked, I2cLink, lambda x: f"I2C bus {x.bus}").items():
        _check_addresses(bus, on_bus)
        why = "is read at one rate"
        _check_same(bus, on_bus, "chip.rate_hz", lambda pod, _: pod.chip.rate_hz, why)
    for bus, nodes in _grouped(linked, CanLink, lambda x: f"CAN {x.interface} {x.channel}").items():
        _check_can(bus, nodes)
    for node, selected in _grouped(linked, SpiLink, lambda x: f"{x.bus}.{x.device}").items():
        if len(selected) > 1:
            (a, _), (b, _) = selected[:2]
            msg = (
                f"pods {a.name} and {b.name}: link.device: both on /dev/spidev{node}; give each a "
                "chip select of its own"
            )
            raise ConfigError(msg)
    _check_ports(linked)


def _grouped(
    pods: Iterable[Linked], kind: type[L], bus_of: Callable[[L], str]
) -> dict[str, list[tuple[Linked, L]]]:
    groups: dict[str, list[tuple[Linked, L]]] = defaultdict(list)
    for pod in pods:
        if isinstance(pod.link, kind):
            groups[bus_of(pod.link)].append((pod, pod.link))
    return groups


def _check_addresses(bus: str, members: Members[I2cLink]) -> None:
    for (a, at_a), (b, at_b) in combinations(members, 2):
        if at_a.address != at_b.address:
            continue
        where = f"0x{at_a.address:02X} of {bus}"
        pair = f"pods {a.name} and {b.name}"
        ways = [(link.mux_address, link.mux_channel) for link in (at_a, at_b)]
        low, high = a.chip.addresses
        remedy = (
            f"give one link.address = 0x{high if at_a.address == low else low:02X}, a channel of "
            "its own (link.mux_address, link.mux_channel) or another link.bus"
        )
        if at_a.mux_address is None and at_b.mux_address is None:
            msg = f"{pair}: link.address: both answer at {where}; {remedy}"
            raise ConfigError(msg)
        if None in (at_a.mux_address, at_b.mux_address):
            direct, behind = (a, b) if at_a.mux_address is None else (b, a)
            msg = (
                f"{pair}: link.address: pod {direct.name} answers at {where} beside every channel "
                f"of the multiplexer that leads to pod {behind.name}; {remedy}"
            )
            raise ConfigError(msg)
        if ways[0] == ways[1]:
            msg = (
                f"{pair}: link.mux_channel: both answer at {where} behind channel "
                f"{at_a.mux_channel} of multiplexer 0x{at_a.mux_address:02X}; {remedy}"
            )
            raise ConfigError(msg)


def _check_can(bus: str, members: Members[CanLink]) -> None:
    for (a, at_a), (b, at_b) in combinations(members, 2):
        if at_a.node == at_b.node:
            msg = (
                f"pods {a.name} and {b.name}: link.node = {at_a.node} for both on {bus}; give each "
                "its own, 0 to 15, and set it in the pod"
            )
            raise ConfigError(msg)
    _check_same(bus, members, "link.bitrate", lambda _, link: link.bitrate, "runs at one bit rate")
    _check_same(
        bus, members, "link.triggered", lambda _, link: link.triggered, "triggers all pods or none"
    )
    if any(link.triggered for _, link in members):
        why = "triggers all pods at one rate"
        _check_same(bus, members, "chip.rate_hz", lambda pod, _: pod.chip.rate_hz, why)
    for pod, _ in members:
        rate_hz = pod.chip.rate_hz
        if rate_hz != round(rate_hz) or not 1 <= rate_hz <= RATE_MAX_HZ:
            msg = (
                f"pod {pod.name}: chip.rate_hz = {rate_hz:g}; a pod on CAN samples at whole rates "
                f"from 1 to {RATE_MAX_HZ} Hz"
            )
            raise ConfigError(msg)


def _check_same(
    bus: str,
    members: Members[L],
    key: str,
    value_of: Callable[[Linked, L], object],
    why: str,
) -> None:
    first, first_link = members[0]
    wanted = value_of(first, first_link)
    for pod, link in members[1:]:
        found = value_of(pod, link)
        if found != wanted:
            msg = (
                f"pods {first.name} and {pod.name}: {key} is {_shown(wanted)} and {_shown(found)} "
                f"on {bus}, which {why}; give all pods of the bus the same"
            )
            raise ConfigError(msg)


def _shown(value: object) -> str:
    if value is None:
        return "absent"
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"


def _check_ports(pods: Iterable[Linked]) -> None:
    """Raise where two links go through one serial port, however its path is spelled."""
    owners: dict[Path, tuple[Linked, str, str]] = {}
    for pod in pods:
        match pod.link:
            case UartLink(port=port):
                name, key = port, "link.port"
            case CanLink(channel=channel) if channel.startswith("/"):
                # A serial CAN adapter; python-can takes a line speed behind the path.
                name, key = channel.partition("@")[0], "link.channel"
            case _:
                continue
        other, other_name, other_key = owners.setdefault(Path(name).resolve(), (pod, name, key))
        if other is not pod and (key, other_key) != ("link.channel", "link.channel"):
            keys = key if key == other_key else f"{other_key} and {key}"
            same = name if name == other_name else f"{other_name} and {name}, which are one port"
            msg = (
                f"pods {other.name} and {pod.name}: {keys}: both on {same}; a serial line has one "
                "chip: give each pod its own"
            )
            raise ConfigError(msg)
