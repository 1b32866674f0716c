"""A pod's core on a bench: the simulated chip on its sensor bus, a list in place of the CAN bus."""

from dataclasses import dataclass, field

import numpy as np

from drivers.can.pod.codec import decode, encode
from drivers.can.pod.messages import COUNTER_NAMES, Axes, Counters, FollowUp, Kind, Sample, Sync
from drivers.errors import BusTimeoutError
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.buses.pod_core import PodCore


class Wobble:
    """A motion with all axes alive: sums of sines, far below full scale."""

    def sense(self, t_ns):
        t = np.asarray(t_ns)[:, None] * 1e-9
        rate = 0.8 * np.sin(2 * np.pi * t * np.array([0.7, 1.1, 0.4]) + np.array([0.0, 1.0, 2.0]))
        force = np.array([0.0, 0.0, -9.81]) + 0.5 * np.sin(2 * np.pi * t * np.array([1, 2, 3]))
        flux = 2e-5 + 1e-5 * np.sin(2 * np.pi * t * np.array([0.1, 0.2, 0.3]))
        return rate, force, flux

    def attitude(self, t_ns):
        return np.eye(3)


@dataclass
class Board:
    """The simulated board of one pod; faults are attributes that a test sets."""

    chip: SimBno055
    time_us: int = 1_000_000
    clock_ppm: float = 0.0
    is_stuck: bool = False
    naks_left: int = 0
    flips_left: int = 0
    is_can_busy: bool = False
    recoveries: int = 0
    resets: int = 0
    stored_node: int | None = None
    sent: list[tuple[int, int, bytes]] = field(default_factory=list)
    gyro_reads: list[bytes] = field(default_factory=list)

    def now_us(self) -> int:
        return round(self.time_us * (1 + self.clock_ppm * 1e-6))

    def _fail(self) -> None:
        if self.is_stuck:
            raise BusTimeoutError("bench: stuck bus")
        if self.naks_left:
            self.naks_left -= 1
            raise OSError(121, "bench: NAK")

    def imu_read(self, register: int, length: int) -> bytes:
        self._fail()
        data = self.chip.read(register, length, self.time_us * 1000)
        if register in (0x08, 0x14):
            if self.flips_left:
                self.flips_left -= 1
                data = data[:-1] + bytes((data[-1] ^ 0x80,))
            self.gyro_reads.append(data[-6:])
        return data

    def imu_write(self, register: int, value: int) -> None:
        self._fail()
        self.chip.write(register, bytes((value,)), self.time_us * 1000)

    def imu_recover(self) -> None:
        self.recoveries += 1

    def can_send(self, mailbox: int, frame_id: int, data: bytes) -> bool:
        if self.is_can_busy:
            return False
        self.sent.append((self.time_us, frame_id, data))
        return True

    def store_node(self, node: int) -> bool:
        self.stored_node = node
        return True

    def reset(self) -> None:
        self.resets += 1


class Bench:
    """One pod, stepped to where it wants to be stepped."""

    def __init__(self, *, node: int = 3, seed: int = 7, uid: bytes = bytes(range(12)), **kwargs):
        self.chip = SimBno055(Wobble(), np.random.default_rng(seed), power_on_ns=1_000_000_000)
        self.board = Board(self.chip, **kwargs)
        self.core = PodCore(self.board, node=node, uid=uid)
        self.node = node

    def run(self, duration_s: float, *, slowest_us: int = 10_000) -> None:
        """Step the pod for ``duration_s`` of its time, at the instants it asks for."""
        end_us = self.board.time_us + round(duration_s * 1e6)
        while self.board.time_us < end_us:
            rest_us = self.core.step()
            self.board.time_us = min(end_us, self.board.time_us + min(max(rest_us, 1), slowest_us))

    def hear(self, message) -> None:
        frame_id, data = encode(message)
        assert self.core.receive(frame_id, data, self.board.now_us())

    def sync(self, seq: int, master_us: int, *, trigger: bool = False, layout: int = 1) -> None:
        """Send one two-step sync whose first frame left at ``master_us``."""
        self.hear(Sync(seq & 255, layout, trigger))
        self.core.step()
        self.hear(FollowUp(seq & 255, master_us))
        self.core.step()

    def messages(self, kind: Kind | None = None) -> list:
        found = [decode(frame_id, data) for _, frame_id, data in self.board.sent]
        return [m for m in found if kind is None or kind_of(m) is kind]

    def counters(self) -> dict[str, int]:
        """The counters as last reported."""
        found: dict[str, int] = {}
        for message in self.messages(Kind.COUNTERS):
            found.update(zip(COUNTER_NAMES[message.page], message.values, strict=True))
        return found


def kind_of(message) -> Kind:
    if isinstance(message, Axes):
        return message.kind
    return {
        Sample: Kind.SAMPLE,
        Counters: Kind.COUNTERS,
    }.get(type(message)) or Kind[_upper(type(message).__name__)]


def _upper(name: str) -> str:
    return "".join(f"_{c}" if c.isupper() and i else c for i, c in enumerate(name)).upper()
