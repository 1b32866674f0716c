"""The factory and python-can's own interfaces behind it, slcan on a pty above all."""

import os
import time
import tty

import can
import pytest

from drivers.can.python_can import open_can
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError


@pytest.fixture
def line():
    """Return (file descriptor of the adapter's end, name of ours)."""
    adapter, ours = os.openpty()
    tty.setraw(adapter)
    tty.setraw(ours)
    os.set_blocking(adapter, False)
    yield adapter, os.ttyname(ours)
    os.close(adapter)
    os.close(ours)


def heard(port, count: int, limit_s: float = 10.0):
    frames, give_up = [], time.monotonic() + limit_s
    while len(frames) < count and time.monotonic() < give_up:
        frame = port.recv(0.05)
        if frame is not None:
            frames.append((frame.arbitration_id, frame.data))
    return frames


@pytest.mark.parametrize(
    "noise",
    [
        b"tZZZ2AABB\r",
        b"t12\r",
        b"t1239AA\r",
        b"\xff\xfe\x80\r",
        b"t1238aa\r",
        b"T\r",
        b"hello world\r",
        b"\a",
    ],
)
def test_slcan_reader_outlives_malformed_lines(line, noise) -> None:
    adapter, name = line
    port = open_can("slcan", name, SteadyClock(), bitrate=500_000, sleep_after_open=0)
    os.write(adapter, b"t10126162\r")
    assert heard(port, 1) == [(0x101, b"ab")]
    for _ in range(3):
        os.write(adapter, noise)
        heard(port, 1, limit_s=0.2)
    # The line is good again within two frames: one may be eaten with the noise before it.
    for _ in range(20):
        os.write(adapter, b"t10226364\r")
        if heard(port, 1, limit_s=0.3) == [(0x102, b"cd")]:
            break
    else:
        pytest.fail("no frame after a malformed line")
    port.close()


def test_unplugged_adapter_is_taken_up_again(tmp_path) -> None:
    """A pty behind a link that moves, as /dev/serial/by-id does."""
    name = tmp_path / "adapter"

    def plug() -> tuple[int, int]:
        adapter, ours = os.openpty()
        tty.setraw(ours)
        name.unlink(missing_ok=True)
        name.symlink_to(os.ttyname(ours))
        return adapter, ours

    first = plug()
    port = open_can("slcan", str(name), SteadyClock(), bitrate=500_000, sleep_after_open=0)
    os.write(first[0], b"t10126162\r")
    assert heard(port, 1) == [(0x101, b"ab")]
    for end in first:
        os.close(end)
    assert heard(port, 1, limit_s=0.3) == []
    second = plug()
    give_up = time.monotonic() + 10
    found = []
    while not found and time.monotonic() < give_up:
        os.write(second[0], b"t10226364\r")
        found = heard(port, 1, limit_s=0.1)
    assert found == [(0x102, b"cd")]
    assert [e.level for e in port.take_events()] == ["warning", "info"]
    port.close()
    for end in second:
        os.close(end)


def test_slcan_sends_what_it_is_given(line) -> None:
    adapter, name = line
    port = open_can("slcan", name, SteadyClock(), bitrate=500_000, sleep_after_open=0)
    os.read(adapter, 100)
    assert port.send(0x123, b"\x01\xff") is not None
    time.sleep(0.05)
    assert b"t123201FF\r" in os.read(adapter, 100)
    port.close()


def test_virtual_bus_and_filters() -> None:
    port = open_can("virtual", "factory", SteadyClock(), identifiers=((0x100, 0x7F0),))
    with can.Bus(interface="virtual", channel="factory") as other:
        for number, extended in ((0x200, False), (0x103, True), (0x103, False)):
            other.send(can.Message(arbitration_id=number, is_extended_id=extended))
        assert heard(port, 2, limit_s=0.3) == [(0x103, b"")]
        assert port.send(0x7, b"x") is not None
        assert other.recv(1).arbitration_id == 0x7
    assert not port.echoes
    port.close()
    port.close()
    assert port.recv(0) is None
    assert port.send(0x7, b"") is None


@pytest.mark.parametrize("interface", ["nosuch", "slcan"])
def test_interface_that_does_not_open_is_named(interface) -> None:
    with pytest.raises(DeviceNotFoundError, match=rf"interface '{interface}' does not open"):
        open_can(interface, "/dev/nosuch", SteadyClock())


def error_frame(classes: int) -> can.Message:
    return can.Message(arbitration_id=classes, is_error_frame=True, is_extended_id=False)


@pytest.mark.parametrize("identifiers", [(), ((0x100, 0x7F0),)])
def test_error_frames_pass_the_port_and_are_counted_and_told(identifiers) -> None:
    port = open_can("virtual", "errors", SteadyClock(), identifiers=identifiers)
    with can.Bus(interface="virtual", channel="errors") as other:
        for classes in (0x40, 0x40, 0x20, 0x20, 0):
            other.send(error_frame(classes))
            frame = port.recv(1)
            assert frame is not None
            assert frame.is_error
            assert frame.arbitration_id == classes
    assert port.counters == {"error_bus_off": 2, "error_no_acknowledge": 2, "error_unnamed": 1}
    told = [(event.level, event.message.split(":")[0]) for event in port.take_events()]
    assert told == [
        ("error", "bus off"),
        ("error", "bus off"),
        ("warning", "no acknowledge"),
        ("warning", "unnamed"),
    ]
    port.close()


def test_line_that_lost_its_end_is_no_frame(line) -> None:
    # GIVEN eight bytes announced and one sent WHEN it is read THEN it counts as malformed
    adapter, name = line
    port = open_can("slcan", name, SteadyClock(), bitrate=500_000, sleep_after_open=0)
    os.write(adapter, b"t1238aa\r")
    assert heard(port, 1, limit_s=0.3) == []
    assert port.counters["malformed"] == 1
    os.write(adapter, b"t10226364\rr1238\r")  # a remote frame has a DLC and no bytes
    assert heard(port, 2) == [(0x102, b"cd"), (0x123, b"")]
    port.close()
