"""The SocketCAN port on the guest's real SocketCAN; without one, what it says."""

import contextlib
import errno
import os
import socket
import struct
import subprocess
import time
from collections import deque

import can
import pytest

from drivers.can.port import CanPort
from drivers.can.python_can import open_can
from drivers.can.socketcan import CAN_ERR_FLAG, SO_TIMESTAMPNS, SocketCanPort
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError

RETURN_S = 1.5


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


def test_absent_interface_is_named_with_its_remedy() -> None:
    with pytest.raises(DeviceNotFoundError, match=r"can nocan9: .*(ip link|modprobe)"):
        open_can("socketcan", "nocan9", SteadyClock())


class Queue:
    """Stands in for the socket: what its kernel holds, frames and failures."""

    def __init__(self) -> None:
        self.held: deque[bytes | OSError] = deque()
        self.stamps_ns: deque[int] = deque()
        self.send_error: OSError | None = None

    def arrive(self, data: bytes) -> None:
        self.held.append(data)
        self.stamps_ns.append(time.time_ns())

    def recvmsg(self, *_sizes: int):
        if not self.held:
            raise BlockingIOError
        head = self.held.popleft()
        if isinstance(head, OSError):
            raise head
        stamp = struct.pack("=qq", *divmod(self.stamps_ns.popleft(), 10**9))
        return head, [(socket.SOL_SOCKET, SO_TIMESTAMPNS, stamp)], 0, ("can9",)

    def send(self, data: bytes) -> int:
        if self.send_error is not None:
            raise self.send_error
        return len(data)

    def close(self) -> None:
        self.held.clear()


@pytest.fixture
def queue(monkeypatch) -> Queue:
    one = Queue()
    monkeypatch.setattr(SocketCanPort, "_open", lambda _port: one)
    return one


def link_is(monkeypatch, *, up: bool) -> None:
    monkeypatch.setattr(SocketCanPort, "_is_link_up", lambda _port: up)
    monkeypatch.setattr(SocketCanPort, "_has_vanished", lambda _port: False)


def drain(port: CanPort) -> int:
    heard = 0
    while port.recv(0) is not None:
        heard += 1
    return heard


def test_frames_queued_before_the_link_went_down_are_no_return(queue, monkeypatch) -> None:
    # GIVEN frames that wait WHEN the link goes down: the kernel gives its error first
    link_is(monkeypatch, up=True)
    port = SocketCanPort("can9", SteadyClock())
    down = OSError(errno.ENETDOWN, os.strerror(errno.ENETDOWN))
    queue.held.append(down)
    for _ in range(3):
        queue.arrive(frame(0x1, b"old"))
    link_is(monkeypatch, up=False)
    queue.send_error = down
    assert port.recv(0) is None
    assert drain(port) == 3
    assert port.send(0x2, b"") is None
    # THEN it is reported once
    assert [e.level for e in port.take_events()] == ["warning"]
    # WHEN frames come that were queued before the failed sending, THEN that is no return either
    link_is(monkeypatch, up=True)
    queue.arrive(frame(0x1, b"old"))
    assert port.send(0x2, b"") is None
    assert drain(port) == 1
    assert port.take_events() == []
    # WHEN the bus only tells of its trouble, THEN neither
    queue.send_error = None
    queue.arrive(struct.pack("=IB3x8s", CAN_ERR_FLAG | 0x40, 8, bytes(8)))
    assert drain(port) == 1
    assert [e.message for e in port.take_events() if e.level == "info"] == []
    # WHEN a frame comes after all that, THEN it is
    queue.arrive(frame(0x1, b"new"))
    assert drain(port) == 1
    assert [e.message for e in port.take_events()] == ["frames again"]
    assert port.counters["returned"] == 1


def test_a_late_frame_of_a_link_that_is_down_is_no_return(queue, monkeypatch) -> None:
    link_is(monkeypatch, up=False)
    port = SocketCanPort("can9", SteadyClock())
    queue.arrive(frame(0x1, b"late"))
    assert drain(port) == 1
    assert [e.level for e in port.take_events()] == ["warning"]


def raw(channel: str) -> socket.socket:
    sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    sock.bind((channel,))
    return sock


def frame(identifier: int, data: bytes) -> bytes:
    return identifier.to_bytes(4, "little") + bytes((len(data), 0, 0, 0)) + data.ljust(8, b"\0")


def heard_within(port: CanPort, sender, timeout_s: float) -> float | None:
    """Seconds until a frame that is sent over and over is heard again."""
    start = time.monotonic()
    while time.monotonic() - start < timeout_s:
        with contextlib.suppress(OSError):
            sender()
        if port.recv(0.02) is not None:
            return time.monotonic() - start
    return None


@pytest.mark.uml
def test_frames_carry_steady_stamps_and_own_frames_come_back(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock())
    with raw(vcan) as other:
        before_ns = time.monotonic_ns()
        other.send(frame(0x123, b"abc"))
        heard = port.recv(1.0)
        after_ns = time.monotonic_ns()
        assert (heard.arbitration_id, heard.data, heard.is_own) == (0x123, b"abc", False)
        assert before_ns - 1_000_000 <= heard.t_ns <= after_ns
        assert port.send(0x124, b"xy") is not None
        echo = port.recv(1.0)
        assert (echo.arbitration_id, echo.is_own) == (0x124, True)
    port.close()
    port.close()
    assert port.recv(0) is None


@pytest.mark.uml
def test_stamps_do_not_bend_when_realtime_steps(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock())
    with raw(vcan) as other:
        other.send(frame(0x1, b""))
        assert port.recv(1.0) is not None
        for step_s in (3, -5):
            sent_ns = time.monotonic_ns()
            other.send(frame(0x1, b""))
            time.clock_settime(time.CLOCK_REALTIME, time.time() + step_s)
            heard = port.recv(1.0)
            assert abs(heard.t_ns - sent_ns) < 100_000_000
            other.send(frame(0x1, b""))
            assert abs(port.recv(1.0).t_ns - time.monotonic_ns()) < 100_000_000
    port.take_events()
    assert port.counters["realtime_steps"] >= 1
    port.close()


@pytest.mark.uml
def test_every_loss_of_a_stalled_reader_is_counted(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock(), receive_buffer_bytes=1 << 16)
    sent = 6000
    with raw(vcan) as other:
        for k in range(sent):
            other.send(frame(0x200, k.to_bytes(4, "little")))
        heard = 0
        while port.recv(0.05) is not None:
            heard += 1
        other.send(frame(0x200, b"last"))  # the count of drops travels with the next frame
        assert port.recv(1.0) is not None
    assert heard < sent
    assert heard + port.counters["rx_dropped"] == sent
    port.close()


@pytest.mark.uml
def test_buffer_holds_a_second_of_a_busy_bus(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock())
    with raw(vcan) as other:
        for k in range(2000):
            other.send(frame(0x200, k.to_bytes(4, "little")))
    heard = 0
    while port.recv(0.05) is not None:
        heard += 1
    assert (heard, port.counters["rx_dropped"]) == (2000, 0)
    port.close()


@pytest.mark.uml
def test_filter_keeps_a_foreign_busy_bus_out(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock(), identifiers=((0x100, 0x7F0),))
    with raw(vcan) as other:
        for k in range(300):
            other.send(frame(0x500 + k % 256, b"foreign"))
        other.send(frame(0x80000105, b"extended"))
        other.send(frame(0x105, b"ours"))
    assert port.recv(1.0).data == b"ours"
    assert port.recv(0.02) is None
    port.close()


@pytest.mark.uml
def test_error_frames_are_delivered_and_told(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock(), identifiers=((0x100, 0x7F0),))
    # What `cansend CHANNEL 20000040#0000000000000000` sends: bus-off.
    subprocess.run(["cansend", vcan, "20000040#0000000000000000"], check=True)
    heard = port.recv(1.0)
    assert heard.is_error
    assert port.counters["error_bus_off"] == 1
    assert any("bus off" in e.message for e in port.take_events())
    port.close()


@pytest.mark.uml
@pytest.mark.parametrize("fault", ["down", "deleted"])
def test_port_returns_after_the_interface_does(vcan, fault) -> None:
    port = SocketCanPort(vcan, SteadyClock())
    if fault == "down":
        ip("link", "set", vcan, "down")
    else:
        ip("link", "del", vcan)
    for _ in range(20):
        assert port.recv(0.02) is None
        assert port.send(0x1, b"") is None
    if fault == "deleted":
        ip("link", "add", vcan, "type", "vcan")
    ip("link", "set", vcan, "up")
    with raw(vcan) as other:
        took_s = heard_within(port, lambda: other.send(frame(0x1, b"")), 5.0)
    assert took_s is not None
    assert took_s < RETURN_S
    levels = [e.level for e in port.take_events()]
    assert levels == ["warning", "info"]
    port.close()


@pytest.mark.uml
def test_full_transmit_queue_is_counted_and_passes() -> None:
    ip("link", "add", "vxa", "type", "vxcan", "peer", "name", "vxb")
    try:
        for name in ("vxa", "vxb"):
            ip("link", "set", name, "up")
        subprocess.run(
            ["tc", "qdisc", "add", "dev", "vxa", "root", "netem", "delay", "20ms", "limit", "10"],
            check=True,
        )
        port = SocketCanPort("vxa", SteadyClock())
        results = [port.send(0x10, bytes(8)) for _ in range(100)]
        assert results.count(None) == port.counters["send_queue_full"] > 50
        time.sleep(0.1)
        assert port.send(0x10, bytes(8)) is not None
        port.close()
    finally:
        subprocess.run(["ip", "link", "del", "vxa"], check=False, capture_output=True)


@pytest.mark.uml
def test_python_can_and_the_port_understand_each_other(vcan) -> None:
    port = SocketCanPort(vcan, SteadyClock())
    with can.Bus(interface="socketcan", channel=vcan) as bus:
        port.send(0x321, b"hello")
        assert bytes(bus.recv(1.0).data) == b"hello"
        bus.send(can.Message(arbitration_id=0x322, data=b"back", is_extended_id=False))
        while (heard := port.recv(1.0)).is_own:
            pass
        assert heard.data == b"back"
    port.close()
