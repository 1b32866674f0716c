"""The socket camera: the newest of what waits, a frozen picture, a server that hangs up."""

import contextlib
import socket
import time
from pathlib import Path

import pytest

from drivers.cameras.socket import SocketCamera
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError
from drivers.samples import Frame
from tests.drivers.cameras.fake_gst_launch import HEIGHT, WIDTH, packet, picture
from tests.drivers.wing_bench import SECOND

FPS = 50.0
PERIOD_NS = round(SECOND / FPS)
CAPS = f"video/x-raw, format=(string)BGR, width=(int){WIDTH}, height=(int){HEIGHT}".encode()


class Server:
    """The program that has the camera; its stamps tell a time of its own."""

    def __init__(self, path: Path) -> None:
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(path))
        self.listener.listen(4)
        self.listener.settimeout(5.0)
        self.t_ns = time.monotonic_ns()
        self.readers: list[socket.socket] = []

    def accept(self) -> None:
        self.readers.append(self.listener.accept()[0])
        self.readers[-1].sendall(packet(2, CAPS + b"\0"))

    def send(self, *numbers: int) -> None:
        """Send one picture after the other at once, stamped a period apart."""
        for number in numbers:
            self.t_ns += PERIOD_NS
            self.readers[-1].sendall(packet(1, picture(number), self.t_ns))

    def close(self) -> None:
        for one in (*self.readers, self.listener):
            one.close()


@pytest.fixture
def server(tmp_path):
    with contextlib.closing(Server(tmp_path / "camera")) as one:
        yield one


@pytest.fixture
def camera(server, tmp_path):
    with contextlib.closing(SocketCamera(tmp_path / "camera", SteadyClock(), fps=FPS)) as one:
        server.accept()
        yield one


def counters(camera: SocketCamera) -> dict[str, int]:
    return camera.health()["camera root"]


def number(frame: Frame | None) -> int:
    assert frame is not None
    return int(frame.image[0, 0, 0])


def test_every_frame_comes_to_a_reader_in_time(server, camera) -> None:
    for k in range(10):
        server.send(k)
        frame = camera.read(2.0)
        assert (number(frame), frame.index, frame.t_ns) == (k, k, server.t_ns)
    assert counters(camera) == {"frames": 10, "dropped": 0}


def test_after_a_stall_the_newest_frame_comes_and_the_others_count(server, camera) -> None:
    server.send(0)
    assert number(camera.read(2.0)) == 0
    # GIVEN 75 frames that wait WHEN the reader is back THEN the last one comes, 74 are dropped
    server.send(*range(1, 76))
    frame = camera.read(2.0)
    assert (number(frame), frame.index, frame.t_ns) == (75, 75, server.t_ns)
    assert (counters(camera)["overtaken"], counters(camera)["dropped"]) == (74, 74)
    assert camera.read(0) is None
    server.send(76)
    assert number(camera.read(2.0)) == 76


def test_frozen_picture_is_told_and_the_camera_connected_anew(server, camera) -> None:
    # GIVEN a picture that stands still for 2.2 s of its stamps WHEN it is read
    server.send(*range(10))
    assert camera.read(2.0) is not None
    for _ in range(110):
        server.send(99)
        with contextlib.suppress(BrokenPipeError):
            camera.read(1.0)
        if counters(camera).get("frozen"):
            break
    # THEN that is reported, and another connection is tried, whose pictures move again
    assert counters(camera)["frozen"] == counters(camera)["restarts"] == 1
    assert [e.message for e in camera.take_events()] == ["the picture is frozen; connecting again"]
    camera.read(0.3)
    server.accept()
    for k in range(20, 26):
        server.send(k)
        assert number(camera.read(2.0)) == k
    assert [e.message for e in camera.take_events()] == ["connected again"]
    assert counters(camera)["restarts"] == 1


def test_hung_up_server_is_told_and_connected_again(server, camera) -> None:
    server.readers[-1].close()
    assert camera.read(0.05) is None
    camera.read(0.5)
    server.accept()
    server.send(7)
    assert number(camera.read(2.0)) == 7
    told = [e.message for e in camera.take_events()]
    assert told[0] == "the program that has the camera hung up; connecting again"
    assert told[1] == "connected again"


def test_garbage_is_refused(server, camera) -> None:
    server.readers[-1].sendall(bytes.fromhex("deadbeef") * 32)
    assert camera.read(0.1) is None
    assert "expected 0100" in camera.take_events()[0].message


def test_nobody_there_is_named(tmp_path) -> None:
    with pytest.raises(DeviceNotFoundError, match="nobody serves frames at"):
        SocketCamera(tmp_path / "none", SteadyClock())
