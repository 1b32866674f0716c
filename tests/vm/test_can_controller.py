"""Our SocketCAN receive path on real controller drivers: two kvaser_pci on one bus."""

import contextlib
import json
import subprocess
import threading
import time

import can
import pytest

from drivers.can.imus import CanImus
from drivers.can.pod.codec import encode
from drivers.can.pod.messages import Axes, Kind, Sample
from drivers.can.socketcan import SocketCanPort
from drivers.clock import SteadyClock

pytestmark = pytest.mark.vm

CHANNELS = ("can0", "can1")
BITRATE = 500_000
PODS = 4


def ip(*words: str) -> str:
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True).stdout


@pytest.fixture(autouse=True)
def bus():
    for channel in CHANNELS:
        timing = ("type", "can", "bitrate", str(BITRATE), "restart-ms", "100")
        ip("link", "set", channel, "up", "txqueuelen", "1000", *timing)
    yield
    for channel in CHANNELS:
        ip("link", "set", channel, "down")


def details(channel: str) -> dict:
    (link,) = json.loads(ip("-json", "-details", "-statistics", "link", "show", channel))
    return link


def overruns() -> int:
    """Return how often the receiving controller said that frames fell off its buffer."""
    return int(details(CHANNELS[1])["stats64"]["rx"]["over_errors"])


def test_controller_has_the_asked_bit_timing() -> None:
    for channel in CHANNELS:
        found = details(channel)["linkinfo"]["info_data"]
        assert found["bittiming"]["bitrate"] == BITRATE
        assert 0.75 <= float(found["bittiming"]["sample_point"]) <= 0.9
        assert found["restart_ms"] == 100
        assert found["state"] == "ERROR-ACTIVE"


def send_tick(sender: can.BusABC, tick: int, node: int) -> None:
    """One sample of one pod with the stamps of 100 Hz, whenever it is sent."""
    for frame in (
        Axes(Kind.GYRO, node, tick % 256, 1, 2, 3),
        Sample(node, tick % 256, tick * 10_000 % (1 << 24)),
    ):
        number, data = encode(frame)
        message = can.Message(arbitration_id=number, data=data, is_extended_id=False)
        sender.send(message, timeout=1.0)


@pytest.fixture
def pods_on_the_bus():
    """Our receiver on one controller, a sender on the other."""
    port = SocketCanPort(CHANNELS[1], SteadyClock())
    imus = CanImus(port, {node: str(node) for node in range(PODS)}, SteadyClock())
    with can.Bus(interface="socketcan", channel=CHANNELS[0]) as sender:
        yield sender, imus, port
    imus.close()


def test_four_pods_between_two_controllers_lose_nothing(pods_on_the_bus, record_property) -> None:
    """Each sample is awaited: emulated controllers have no bit rate that would hold a sender."""
    sender, imus, _ = pods_on_the_bus
    before, ticks, start = overruns(), 200, time.monotonic()
    for tick in range(ticks):
        for node in range(PODS):
            send_tick(sender, tick, node)
            sample = imus.read(5.0)
            assert sample is not None
            assert sample.pod == str(node)
    record_property("frames_per_s", 2 * PODS * ticks / (time.monotonic() - start))
    health = imus.health()
    assert health[f"can {CHANNELS[1]}"].get("rx_dropped", 0) == 0
    for node in range(PODS):
        counters = health[f"pod {node}"]
        assert counters["samples"] == ticks
        assert counters.get("samples_lost", 0) == counters.get("samples_incomplete", 0) == 0
    assert overruns() == before


def test_what_a_controller_overran_is_counted_and_said(pods_on_the_bus, record_property) -> None:
    """A burst beyond the controller's 64 bytes; vcan and slcan cannot lose frames like this."""
    sender, imus, port = pods_on_the_bus
    before, burst = overruns(), 100

    def send() -> None:
        for tick in range(burst):
            for node in range(PODS):
                send_tick(sender, tick, node)

    thread = threading.Thread(target=send)
    thread.start()
    while thread.is_alive() or imus.read(0.0) is not None:
        imus.read(0.05)
    for node in range(PODS):
        send_tick(sender, burst, node)  # closes the last gap
        assert imus.read(5.0) is not None
    health = imus.health()
    lost = 0
    for node in range(PODS):
        counters = health[f"pod {node}"]
        gone = counters.get("samples_lost", 0) + counters.get("samples_incomplete", 0)
        assert counters["samples"] + gone == burst + 1
        lost += gone
    overran = overruns() - before
    record_property("samples_lost", lost)
    record_property("overruns", overran)
    assert (lost > 0) == (overran > 0) == (port.counters["error_controller"] > 0)


def test_stamps_are_of_the_interrupt_and_own_frames_come_back_sent() -> None:
    """The controller echoes a frame when it has left, not when it was queued."""
    with (
        contextlib.closing(SocketCanPort(CHANNELS[0], SteadyClock())) as one,
        contextlib.closing(SocketCanPort(CHANNELS[1], SteadyClock())) as other,
    ):
        before_ns = time.monotonic_ns()
        queued_ns = one.send(0x123, b"\x01\x02")
        arrived, echo = other.recv(2.0), one.recv(2.0)
        after_ns = time.monotonic_ns()
        assert (arrived.arbitration_id, arrived.data) == (0x123, b"\x01\x02")
        assert echo.is_own
        assert not arrived.is_own
        assert before_ns <= queued_ns <= echo.t_ns <= after_ns
        assert before_ns <= arrived.t_ns <= after_ns


def test_port_returns_after_the_controller_was_down(record_property) -> None:
    with (
        contextlib.closing(SocketCanPort(CHANNELS[0], SteadyClock())) as one,
        contextlib.closing(SocketCanPort(CHANNELS[1], SteadyClock())) as other,
    ):
        ip("link", "set", CHANNELS[1], "down")
        assert other.recv(0.5) is None
        ip("link", "set", CHANNELS[1], "up")
        start, found = time.monotonic(), None
        while found is None and time.monotonic() - start < 10.0:
            one.send(0x123, b"\x01")
            found = other.recv(0.05)
        record_property("return_s", time.monotonic() - start)
        assert found is not None
        assert time.monotonic() - start < 1.5
        assert other.counters["returned"] == 1
