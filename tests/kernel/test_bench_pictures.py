"""How the bench's pictures go out: on a socket, on a page, to a V4L2 device."""

import socket
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from drivers.cameras.socket import SocketCamera
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError
from drivers.samples import Frame
from sim_bus.bench.frame_server import FrameServer
from sim_bus.bench.v4l2_output import V4l2Output
from sim_bus.bench.window import Window


def frame(value: int, width: int = 30) -> Frame:
    return Frame(1000 + value, "root", value, np.full((8, width), value, np.uint8))


@pytest.mark.parametrize("width", [30, 32])
def test_frames_cross_the_socket_whole_with_their_stamps(tmp_path: Path, width: int) -> None:
    server = FrameServer(tmp_path / "camera.sock", 30.0)
    clock = SteadyClock()
    camera = SocketCamera(server.path, clock, fps=30.0)
    try:
        give_up = time.monotonic() + 10
        while not server.is_watched and time.monotonic() < give_up:
            time.sleep(0.01)
        found = []
        for value in range(5):
            sent = Frame(clock.now_ns(), "root", value, frame(value, width).image)
            server.send(sent)
            got = camera.read(5.0)
            found.append((got.t_ns == sent.t_ns, bool((got.image == value).all())))
        assert found == [(True, True)] * 5
    finally:
        camera.close()
        server.close()


def test_reader_that_does_not_read_misses_frames_and_delays_nobody(tmp_path: Path) -> None:
    server = FrameServer(tmp_path / "camera.sock", 30.0)
    try:
        with socket.socket(socket.AF_UNIX) as sleeper:
            sleeper.connect(str(server.path))
            give_up = time.monotonic() + 10
            while not server.is_watched and time.monotonic() < give_up:
                time.sleep(0.01)
            big = Frame(0, "root", 0, np.zeros((1000, 1000), np.uint8))
            for _ in range(20):
                server.send(big)
        assert server.missed >= 15
    finally:
        server.close()


def test_page_shows_the_newest_frame() -> None:
    window = Window("127.0.0.1:0")
    try:
        page = urllib.request.urlopen(window.address, timeout=10).read()
        assert b'src="/stream"' in page
        stream = urllib.request.urlopen(window.address + "stream", timeout=10)
        give_up = time.monotonic() + 10
        while not window.is_watched and time.monotonic() < give_up:
            time.sleep(0.01)
        window.send(frame(200))
        head = stream.readline() + stream.readline() + stream.readline()
        assert b"image/jpeg" in head
        length = int(head.split(b"Content-Length:")[1])
        stream.readline()
        assert stream.read(length)[:2] == b"\xff\xd8"
        stream.close()
    finally:
        window.close()


def test_page_on_a_taken_port_is_told() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(DeviceNotFoundError, match="cannot listen"):
            Window(f"127.0.0.1:{taken.getsockname()[1]}")


@pytest.mark.parametrize("device", ["/dev/null", "/dev/video-none"])
def test_no_v4l2_output_is_told_with_its_remedy(device: str) -> None:
    with pytest.raises(DeviceNotFoundError, match="v4l2loopback"):
        V4l2Output(device, 640, 480)
