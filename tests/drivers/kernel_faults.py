"""Faults that only a real kernel has, on a pod behind vcan; runs inside the guest.

``python -m tests.drivers.kernel_faults`` prints the outcomes as JSON.
"""

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from drivers.can.imus import CanImus
from drivers.can.pod.codec import filters
from drivers.can.port import CanFrame
from drivers.can.socketcan import SocketCanPort
from drivers.clock import SteadyClock
from sim_bus.bench.served_can import ServedCan
from sim_bus.buses.can_pod import SimPod
from sim_bus.chip.bno055.chip import SimBno055
from tests.drivers.wing_bench import GOOD, Swing

CHANNEL = "vcan4"
FOREIGN_ID = 0x5A5
LEAD_S, TAIL_S = 1.5, 3.0


@dataclass(frozen=True)
class KernelCase:
    """One fault; ``recovery_s`` is the longest time from its end to the next sample."""

    kind: str
    for_s: float
    counter: str
    recovery_s: float
    expected: str


CASES = (
    KernelCase("link_down", 0.5, "returned", 1.5, "reported once; received again when it is up"),
    KernelCase("link_deleted", 0.5, "reopened", 1.5, "reported once; opened again when it is back"),
    KernelCase("reader_stalled", 1.0, "rx_dropped", 0.6, "every frame the kernel dropped counted"),
    KernelCase(
        "bus_off_frame", 0.1, "error_bus_off", 0.3, "reported and counted; the frames go on"
    ),
    KernelCase("foreign_bus_busy", 1.0, "foreign_on_bus", 0.3, "kept out by the kernel's filters"),
    KernelCase("queue_full", 1.0, "send_queue_full", 0.5, "counted; the next sync goes out"),
)


@dataclass(frozen=True)
class KernelOutcome:
    """What a case did."""

    kind: str
    recovery_s: float
    lost: int
    counters: dict[str, int]


class CountedPort(SocketCanPort):
    """A port that counts what it delivers."""

    received = 0

    def recv(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame."""
        frame = super().recv(timeout_s)
        self.received += frame is not None
        return frame

    def drain(self) -> int:
        """Take what is left on a quiet bus; returns how many frames came in all."""
        while self.recv(0.05) is not None:
            pass
        return self.received


def ip(*words: str) -> None:
    """Run ip(8)."""
    subprocess.run(["ip", *words], check=True, capture_output=True)


def bring_up() -> None:
    """Make the virtual bus; its echo flag lets netem see what leaves."""
    ip("link", "add", CHANNEL, "type", "vcan")
    ip("link", "set", CHANNEL, "up")


@contextlib.contextmanager
def pod() -> Iterator[None]:
    """Let a pod fly on the bus."""
    clock = SteadyClock()
    chip = SimBno055(
        Swing(), np.random.default_rng(1), grade=GOOD, power_on_ns=clock.now_ns() - 10**9
    )
    station = ServedCan("socketcan", CHANNEL, None, clock)
    station.start([SimPod(0, chip, station.tap(), clock, uid=bytes(range(12)))])
    try:
        yield
    finally:
        station.close()


def run(case: KernelCase) -> KernelOutcome:
    """Run one case."""
    bring_up()
    port = CountedPort(
        CHANNEL, SteadyClock(), identifiers=filters(),
        receive_buffer_bytes=1 << 14 if case.kind == "reader_stalled" else 1 << 20,
    )  # fmt: skip
    # What it hears of the bus goes through no small buffer.
    heard = ((FOREIGN_ID, 0x7FF),) if case.kind == "foreign_bus_busy" else filters()
    witness = CountedPort(CHANNEL, SteadyClock(), identifiers=heard, receive_buffer_bytes=1 << 23)
    imus = CanImus(port, {0: "0"}, SteadyClock())
    try:
        with pod():
            imus.open(20.0)
            _read(imus, LEAD_S)
            before, lost = _counters(imus), imus.health()["pod 0"].get("samples_lost", 0)
            _inject(case, imus)
            back_s = _until_sample(imus, 10.0)
            _read(imus, TAIL_S - min(back_s, TAIL_S - 0.5))
            after = _counters(imus)
            lost = imus.health()["pod 0"].get("samples_lost", 0) - lost
        received = port.drain()
        after["rx_dropped"] = port.counters["rx_dropped"]
        on_bus = witness.drain()
        assert not witness.counters["rx_dropped"]
    finally:
        imus.close()
        witness.close()
        subprocess.run(["ip", "link", "del", CHANNEL], check=False, capture_output=True)
    counted = {k: v - before.get(k, 0) for k, v in after.items() if v > before.get(k, 0)}
    if case.kind == "reader_stalled":
        counted.update(frames_sent=on_bus, frames_received=received)
    elif case.kind == "foreign_bus_busy":
        counted["foreign_on_bus"] = on_bus
    return KernelOutcome(case.kind, back_s, lost, counted)


def _inject(case: KernelCase, imus: CanImus) -> None:
    """Do what goes wrong, for as long as it lasts."""
    if case.kind == "link_down":
        ip("link", "set", CHANNEL, "down")
        _read(imus, case.for_s)
        ip("link", "set", CHANNEL, "up")
    elif case.kind == "link_deleted":
        ip("link", "del", CHANNEL)
        _read(imus, case.for_s)
        bring_up()
    elif case.kind == "reader_stalled":
        time.sleep(case.for_s)
    elif case.kind == "bus_off_frame":
        subprocess.run(["cansend", CHANNEL, "20000040#0000000000000000"], check=True)
        _read(imus, case.for_s)
    elif case.kind == "foreign_bus_busy":
        busy = subprocess.Popen(["cangen", CHANNEL, "-I", f"{FOREIGN_ID:X}", "-L", "8", "-g", "2"])
        _read(imus, case.for_s)
        busy.terminate()
        busy.wait()
    else:
        tc = ("tc", "qdisc")
        limited = ("root", "netem", "delay", "400ms", "limit", "1")
        subprocess.run([*tc, "add", "dev", CHANNEL, *limited], check=True)
        _read(imus, case.for_s)
        subprocess.run([*tc, "del", "dev", CHANNEL, "root"], check=True)


def _read(imus: CanImus, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        imus.read(0.02)


def _until_sample(imus: CanImus, limit_s: float) -> float:
    start = time.monotonic()
    while time.monotonic() - start < limit_s:
        sample = imus.read(0.02)
        if sample is not None and sample.t_ns * 1e-9 > start - 0.1:
            break
    return time.monotonic() - start


def _counters(imus: CanImus) -> dict[str, int]:
    return {name: n for group in imus.health().values() for name, n in group.items()}


if __name__ == "__main__":
    json.dump([asdict(run(case)) for case in CASES], sys.stdout)
