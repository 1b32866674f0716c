"""Simulated pods on one real python-can bus: SocketCAN, an adapter, slcan, simbus, ...

One bus object serves every pod, because most adapters can be opened once only. An interface that
goes down or vanishes is waited for; pods fly on meanwhile, as real ones would.
"""

import contextlib
import threading
from collections import Counter, deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import can

from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from sim_bus.buses.can_pod import SimPod

LONGEST_WAIT_S: Final = 0.02
REOPEN_NS: Final = 200_000_000
NETWORK: Final = Path("/sys/class/net")


class Tap:
    """What one pod sees of the shared bus: the part of ``can.BusABC`` that ``SimPod`` uses."""

    def __init__(self, station: "ServedCan") -> None:
        self.inbox: deque[can.Message] = deque(maxlen=256)
        self._station = station

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next message received; never waits."""
        return self.inbox.popleft() if self.inbox else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send to the bus, and to the other simulated pods on it."""
        self._station.send(msg, self)

    def shutdown(self) -> None:
        """Do nothing: the station owns the bus."""


class ServedCan:
    """A bus with simulated pods; its own thread steps them when they or the bus want it.

    Parameters
    ----------
    interface, channel : str
        python-can interface and channel.
    bitrate : int or None
        Bit rate where the interface sets it, bit/s.
    clock : Clock
        The steady clock.

    Raises
    ------
    DeviceNotFoundError
        If the bus does not open.
    """

    def __init__(self, interface: str, channel: str, bitrate: int | None, clock: Clock) -> None:
        self.name = f"{interface} {channel}"
        self.counters: Counter[str] = Counter()
        self._options: dict[str, Any] = {"interface": interface, "channel": channel}
        if bitrate is not None:
            self._options["bitrate"] = bitrate
        self._clock = clock
        self._bus: can.BusABC | None = None
        self._taps: list[Tap] = []
        self._pods: Sequence[SimPod] = ()
        self._retry_ns = 0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        try:
            self._bus = can.Bus(**self._options)
        except (can.CanError, OSError, ValueError) as error:
            advice = _advice(interface, channel)
            msg = f"can {channel}: interface {interface} does not open: {error}; {advice}"
            raise DeviceNotFoundError(msg) from error

    def tap(self) -> Tap:
        """Return a pod's view of the bus."""
        self._taps.append(Tap(self))
        return self._taps[-1]

    def start(self, pods: Sequence[SimPod]) -> None:
        """Switch the pods on."""
        self._pods = pods
        self._thread = threading.Thread(target=self._serve, name=self.name, daemon=True)
        self._thread.start()

    def send(self, message: can.Message, sender: Tap) -> None:
        """Send a pod's message; what no bus takes is counted."""
        for tap in self._taps:
            if tap is not sender:
                tap.inbox.append(message)
        if self._bus is None:
            self.counters["lost_bus_down"] += 1
            return
        try:
            self._bus.send(message)
            self.counters["sent"] += 1
        except (can.CanError, OSError) as error:
            self.counters["send_failed"] += 1
            if getattr(error, "error_code", None) != _ENOBUFS:
                self._drop()

    def close(self) -> None:
        """Switch the pods off and leave the bus; may be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(2.0)
            self._thread = None
        for pod in self._pods:
            pod.close()
        self._pods = ()
        self._drop()

    def _drop(self) -> None:
        self._retry_ns = self._clock.now_ns() + REOPEN_NS
        if self._bus is not None:
            bus, self._bus = self._bus, None
            with contextlib.suppress(can.CanError, OSError):
                bus.shutdown()

    def _serve(self) -> None:
        while not self._stop.is_set():
            due_ns = min((pod.due_ns for pod in self._pods), default=1 << 62)
            wait_s = min(max(0.0, (due_ns - self._clock.now_ns()) * 1e-9), LONGEST_WAIT_S)
            self._hear(wait_s)
            now_ns = self._clock.now_ns()
            for pod, tap in zip(self._pods, self._taps, strict=True):
                if pod.due_ns <= now_ns or tap.inbox:
                    pod.step(now_ns)

    def _hear(self, wait_s: float) -> None:
        """Wait for the bus, at most ``wait_s``, and hand what came to every pod."""
        if self._bus is None:
            if self._clock.now_ns() >= self._retry_ns:
                self._reopen()
            self._stop.wait(wait_s)
            return
        try:
            message = self._bus.recv(wait_s)
            while message is not None:
                self.counters["heard"] += 1
                for tap in self._taps:
                    tap.inbox.append(message)
                message = self._bus.recv(0)
        except (can.CanError, OSError, ValueError):
            self.counters["recv_failed"] += 1
            self._drop()

    def _reopen(self) -> None:
        self._retry_ns = self._clock.now_ns() + REOPEN_NS
        interface = self._options["interface"]
        if interface == "socketcan" and not (NETWORK / self._options["channel"]).exists():
            return  # python-can would leave a socket open at every attempt
        with contextlib.suppress(can.CanError, OSError, ValueError):
            self._bus = can.Bus(**self._options)
            self.counters["reopened"] += 1


_ENOBUFS: Final = 105


def _advice(interface: str, channel: str) -> str:
    if interface == "socketcan":
        return (
            f"`ip link add {channel} type vcan && ip link set {channel} up`, or for an adapter "
            f"`ip link set {channel} up type can bitrate 500000`; without SocketCAN use "
            "--interface simbus, or `avionics rig run -- ...`"
        )
    return "see python-can's page on the interface for what it needs"
