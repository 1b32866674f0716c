"""The python-can interface that several processes share."""

import os
import pty
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest

from drivers.can.python_can import open_can
from drivers.clock import SteadyClock
from sim_bus.buses.simbus_can import SimbusBus, pack, unpack
from sim_bus.buses.simbus_hub import Hub


@pytest.fixture
def channel(tmp_path) -> str:
    return str(tmp_path / "bus.sock")


def join(channel: str, **options) -> can.BusABC:
    return can.Bus(interface="simbus", channel=channel, **options)


def message(number: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=number, data=data, is_extended_id=False)


@pytest.mark.parametrize(
    "sent",
    [
        can.Message(arbitration_id=0x123, data=b"12345678", is_extended_id=False, timestamp=7.25),
        can.Message(arbitration_id=0x1ABCDEF0, data=b"", is_extended_id=True),
        can.Message(arbitration_id=0x5, is_remote_frame=True, dlc=4, is_extended_id=False),
        can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8), is_extended_id=False),
        can.Message(arbitration_id=0x6, is_fd=True, bitrate_switch=True, data=bytes(64)),
    ],
)
def test_every_kind_of_frame_survives_the_packet(sent) -> None:
    assert unpack(pack(sent), "x").equals(sent, timestamp_delta=0, check_channel=False)


def test_all_others_hear_and_the_sender_does_not(channel) -> None:
    with join(channel) as a, join(channel) as b, join(channel, receive_own_messages=True) as c:
        a.send(message(1, b"a"))
        assert [bytes(m.recv(2).data) for m in (b, c)] == [b"a", b"a"]
        c.send(message(2))
        echo = c.recv(2)
        assert (echo.arbitration_id, echo.is_rx) == (2, False)
        assert a.recv(2).arbitration_id == b.recv(2).arbitration_id == 2
        assert a.recv(0) is None


def test_filters_work(channel) -> None:
    only = [{"can_id": 0x100, "can_mask": 0x7F0, "extended": False}]
    with join(channel) as a, join(channel, can_filters=only) as b:
        a.send(message(0x200))
        a.send(message(0x105))
        assert b.recv(2).arbitration_id == 0x105


def test_members_go_on_when_the_serving_one_leaves(channel) -> None:
    first = join(channel)
    with join(channel) as b, join(channel) as c:
        first.shutdown()
        assert b.recv(0.05) is None
        assert c.recv(0.05) is None
        b.send(message(9))
        assert c.recv(2).arbitration_id == 9


def test_bus_survives_a_killed_server(channel) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "sim_bus.buses.simbus_can", channel], start_new_session=True
    ) as server:
        give_up = time.monotonic() + 20
        while not Path(channel).exists() and time.monotonic() < give_up:
            time.sleep(0.02)
        with join(channel) as a, join(channel) as b:
            a.send(message(1))
            assert b.recv(2).arbitration_id == 1
            server.send_signal(signal.SIGKILL)
            server.wait()
            assert a.recv(0.05) is None
            assert b.recv(0.05) is None
            a.send(message(2))
            assert b.recv(2).arbitration_id == 2


def test_a_stalled_member_stalls_nobody(channel) -> None:
    with join(channel) as a, join(channel) as b, join(channel):
        for k in range(30_000):
            a.send(message(k % 0x7FF, b"12345678"))
            if k % 100 == 0:
                while b.recv(0) is not None:
                    pass
        while b.recv(0.1) is not None:
            pass
        a.send(message(0x7F0))
        assert b.recv(2).arbitration_id == 0x7F0


def test_second_hub_on_a_channel_is_refused(channel) -> None:
    hub = Hub(Path(channel))
    with pytest.raises(BlockingIOError):
        Hub(Path(channel))
    hub.close()
    Hub(Path(channel)).close()


def test_can_logger_of_python_can_records_the_bus(channel, tmp_path) -> None:
    log = tmp_path / "bus.log"
    script = Path(sys.executable).with_name("can_logger")
    with (
        join(channel) as bus,
        subprocess.Popen(
            [str(script), "-i", "simbus", "-c", channel, "-f", str(log)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        ) as logger,
    ):
        give_up = time.monotonic() + 30
        while time.monotonic() < give_up:
            bus.send(message(0x321, b"seen"))
            time.sleep(0.05)
            if log.exists() and "321#7365656E" in log.read_text(encoding="ascii"):
                break
        logger.send_signal(signal.SIGINT)
        logger.communicate(timeout=20)
    assert "321#7365656E" in log.read_text(encoding="ascii")


def test_can_viewer_of_python_can_shows_the_bus(channel) -> None:
    script = Path(sys.executable).with_name("can_viewer")
    screen, terminal = pty.openpty()
    size = {"TERM": "xterm", "LINES": "24", "COLUMNS": "100"}
    with (
        join(channel) as bus,
        subprocess.Popen(
            [str(script), "-i", "simbus", "-c", channel],
            stdin=terminal, stdout=terminal, stderr=terminal, env={**os.environ, **size},
        ) as viewer,
    ):  # fmt: skip
        os.close(terminal)
        shown, give_up = "", time.monotonic() + 30
        try:
            while "73 65 65 6E" not in shown and time.monotonic() < give_up:
                bus.send(message(0x321, b"seen"))
                if select.select([screen], [], [], 0.05)[0]:
                    shown += os.read(screen, 65536).decode(errors="replace")
            os.write(screen, b"q")
            assert viewer.wait(timeout=20) == 0
        finally:
            viewer.kill()
            os.close(screen)
    assert "73 65 65 6E" in shown, shown


def test_our_own_factory_opens_it(channel) -> None:
    port = open_can("simbus", channel, SteadyClock())
    with join(channel) as other:
        other.send(message(0x10, b"x"))
        assert port.recv(2).data == b"x"
    port.close()


def test_available_buses_are_detected(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with join("alpha"):
        assert SimbusBus._detect_available_configs() == [
            {"interface": "simbus", "channel": "alpha"}
        ]
