"""Where the bench puts each simulated pod: on its own kind of bus if that is offered."""

from dataclasses import dataclass

from avionics.config import Config, Pod
from avionics.config.links import CanLink, I2cLink, Link, UartLink
from avionics.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """The buses of a bench.

    Attributes
    ----------
    can : str or None
        python-can channel.
    interface : str
        python-can interface.
    bitrate : int or None
        Where the interface sets it, bit/s.
    i2c_dev : int or None
        N of the first /dev/i2c-N.
    uart : bool
        Whether ptys are made.
    uart_devices : tuple of str
        Real serial ports to use instead of ptys, in the order of the pods.
    pods : frozenset of int or None
        Which pods are simulated; None = all.
    """

    can: str | None = None
    interface: str = "socketcan"
    bitrate: int | None = None
    i2c_dev: int | None = None
    uart: bool = False
    uart_devices: tuple[str, ...] = ()
    pods: frozenset[int] | None = None

    @property
    def has_uart(self) -> bool:
        """Whether serial lines are offered."""
        return self.uart or bool(self.uart_devices)


def place_pods(config: Config, offer: Offer) -> dict[str, Link]:
    """Return the link of every simulated pod by name; a pty's path is filled in later.

    A pod stays on its own kind of bus where that is offered; otherwise it moves to CAN, then to a
    serial line, then to I2C.

    Raises
    ------
    ConfigError
        If a wanted pod does not exist, nothing is offered to put a pod on, or something is offered
        that no pod uses.
    """
    known = {pod.id for pod in config.pods}
    wanted = known if offer.pods is None else set(offer.pods)
    if wanted - known:
        absent = sorted(wanted - known)
        msg = f"--pods: no pod {absent} in the configuration, which has {sorted(known)}"
        raise ConfigError(msg)
    places: dict[str, Link] = {}
    pods = [pod for pod in config.pods if pod.id in wanted]
    own_buses = sorted({p.link.bus for p in pods if isinstance(p.link, I2cLink)})
    nodes = {p.link.node for p in config.pods if isinstance(p.link, CanLink)}
    triggered = any(p.link.triggered for p in pods if isinstance(p.link, CanLink))
    for pod in pods:
        kind = _kind(pod, offer)
        if kind == "can":
            places[pod.name] = _on_can(pod, offer, nodes, triggered=triggered)
        elif kind == "uart":
            places[pod.name] = UartLink(kind="uart", port="pty")
        else:
            places[pod.name] = _on_i2c(pod, offer, own_buses, places)
    _check_used(offer, places)
    return places


def _check_used(offer: Offer, places: dict[str, Link]) -> None:
    """Refuse what is offered and takes no pod."""
    used = [link.kind for link in places.values()]
    options = {
        "can": ("--can", '{ kind = "can", interface = "virtual", channel = "any", node = 1 }'),
        "uart": ("--uart", '{ kind = "uart", port = "pty" }'),
        "i2c": ("--i2c-dev", '{ kind = "i2c", bus = 1, address = 0x28 }'),
    }
    for kind, (option, link) in options.items():
        if _offered(offer)[kind] and kind not in used:
            where = ", ".join(f"pod {name} on {place.kind}" for name, place in places.items())
            msg = (
                f"{option}: no pod would be there ({where}); a pod stays on its own kind of bus: "
                f"write link = {link} into its [[pods]] of CONFIG.toml, or leave {option} out"
            )
            raise ConfigError(msg)
    spare = offer.uart_devices[used.count("uart") :]
    if spare:
        msg = f"--uart-device {spare[0]}: there are {used.count('uart')} pods on serial lines only"
        raise ConfigError(msg)


def _offered(offer: Offer) -> dict[str, bool]:
    return {
        "can": offer.can is not None,
        "uart": offer.has_uart,
        "i2c": offer.i2c_dev is not None,
    }


def _kind(pod: Pod, offer: Offer) -> str:
    offered = _offered(offer)
    own = pod.link.kind if pod.link is not None else "i2c"
    for kind in (own, *offered):
        if offered.get(kind) and kind in pod.chip.links:
            return kind
    options = {"can": "--can CHANNEL", "uart": "--uart", "i2c": "--i2c-dev N"}
    wanted = ", ".join(option for kind, option in options.items() if kind in pod.chip.links)
    msg = (
        f"pod {pod.id}: no bus to put its {pod.chip.title} on; give one of {wanted}, or leave it "
        "to hardware with --pods"
    )
    raise ConfigError(msg)


def _on_can(pod: Pod, offer: Offer, nodes: set[int], *, triggered: bool) -> CanLink:
    assert offer.can is not None
    if isinstance(pod.link, CanLink):
        node = pod.link.node
    else:
        node = pod.id if pod.id <= 15 and pod.id not in nodes else min(set(range(16)) - nodes)
        nodes.add(node)
    return CanLink(
        kind="can",
        interface=offer.interface,
        channel=offer.can,
        bitrate=offer.bitrate,
        node=node,
        triggered=triggered,
    )


def _on_i2c(pod: Pod, offer: Offer, own_buses: list[int], places: dict[str, Link]) -> I2cLink:
    assert offer.i2c_dev is not None
    if isinstance(pod.link, I2cLink):
        number = offer.i2c_dev + own_buses.index(pod.link.bus)
        return pod.link.model_copy(update={"bus": number})
    taken = {(p.bus, p.address) for p in places.values() if isinstance(p, I2cLink)}
    number = offer.i2c_dev + len(own_buses)
    while True:
        for address in pod.chip.addresses:
            if (number, address) not in taken:
                return I2cLink(bus=number, address=address)
        number += 1
