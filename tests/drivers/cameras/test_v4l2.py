"""The V4L2 camera on a scripted ``cv2.VideoCapture``: modes, controls, stamps, death and return."""

import threading
import time

import cv2
import numpy as np
import pytest

from drivers.cameras import v4l2 as v4l2_camera
from drivers.cameras.v4l2 import V4l2Camera
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError


class ScriptedCapture:
    """A device with 64 x 48 pixels; the class attributes say how it behaves."""

    number = 0
    stamp_shift_ms = 0.0
    dies_at: int | None = None
    stands_still = False
    ignores: tuple[int, ...] = ()
    refuses: tuple[int, ...] = ()
    opened = 0
    gate = threading.Event()

    def __init__(self) -> None:
        self.values = {cv2.CAP_PROP_FRAME_WIDTH: 64.0, cv2.CAP_PROP_FRAME_HEIGHT: 48.0}
        self.stamp_ms = 0.0

    def open(self, device, backend) -> bool:
        type(self).opened += 1
        return True

    def isOpened(self) -> bool:
        return True

    def set(self, prop, value) -> bool:
        fixed = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, *self.ignores)
        if prop not in (*fixed, *self.refuses):
            self.values[prop] = value
        return prop not in self.refuses

    def get(self, prop) -> float:
        return self.stamp_ms if prop == cv2.CAP_PROP_POS_MSEC else self.values.get(prop, 0.0)

    def read(self):
        self.gate.wait(0.005)  # about 200 frames a second
        number = type(self).number
        if self.dies_at is not None and number >= self.dies_at:
            type(self).dies_at = None
            return False, None
        type(self).number += 1
        self.stamp_ms = time.monotonic_ns() * 1e-6 + self.stamp_shift_ms
        shade = 7 if self.stands_still else number % 256
        return True, np.full((48, 64, 3), shade, dtype=np.uint8)

    def release(self) -> None:
        pass


@pytest.fixture
def node(tmp_path):
    path = tmp_path / "video0"
    path.touch()
    return path


@pytest.fixture
def device(monkeypatch, node):
    """Return a call that opens a camera on a device that behaves as told."""
    opened = []

    def make(behaviour: dict | None = None, **options) -> V4l2Camera:
        capture = type(
            "Capture", (ScriptedCapture,), {"opened": 0, "number": 0, **(behaviour or {})}
        )
        monkeypatch.setattr(v4l2_camera.cv2, "VideoCapture", capture)
        size = {"width_px": 64, "height_px": 48, "fps": 200.0}
        opened.append(V4l2Camera(str(node), SteadyClock(), **{**size, **options}))
        opened[-1].capture = capture
        return opened[-1]

    yield make
    for camera in opened:
        camera.close()
        camera.close()


def collect(camera, count: int, limit_s: float = 15.0):
    frames, give_up = [], time.monotonic() + limit_s
    while len(frames) < count and time.monotonic() < give_up:
        frame = camera.read(0.2)
        if frame is not None:
            frames.append(frame)
    return frames


def test_frames_carry_the_kernels_monotonic_stamps(device) -> None:
    camera = device(stamp_to_middle_s=-0.003)
    before_ns = time.monotonic_ns()
    frames = collect(camera, 20)
    assert len(frames) == 20
    assert camera.counters["stamped_by_arrival"] == 0
    assert before_ns - 10_000_000 < frames[0].t_ns < time.monotonic_ns() - 3_000_000
    indices = [f.index for f in frames]
    assert indices == sorted(set(indices))


def test_stamp_of_another_clock_is_replaced_and_counted(device) -> None:
    camera = device({"stamp_shift_ms": 29_000.0})  # the Jetson's TSC (spec, pitfalls)
    frames = collect(camera, 5)
    assert camera.counters["stamped_by_arrival"] >= 5
    assert abs(frames[-1].t_ns - time.monotonic_ns()) < 1e9


def test_fixed_controls_are_set_and_read_back(device) -> None:
    camera = device(
        {"ignores": (cv2.CAP_PROP_GAIN,)}, exposure_us=2000, gain=4, white_balance_k=5000
    )
    assert camera.settings["exposure_100us"] == 20
    assert camera.settings["exposure_mode"] == 1
    assert camera.settings["white_balance_k"] == 5000
    warnings = [e.message for e in camera.take_events() if e.level == "warning"]
    assert warnings == ["gain = 4, reads back 0"]


def test_control_that_the_device_lacks_is_said_and_not_reported(device, node) -> None:
    camera = device({"refuses": (cv2.CAP_PROP_GAIN,)}, gain=4)
    assert "gain" not in camera.settings
    warnings = [e.message for e in camera.take_events() if e.level == "warning"]
    assert warnings == [f"gain = 4 is refused: {node} has it not"]


def test_other_mode_than_configured_is_an_error(device) -> None:
    with pytest.raises(
        DeviceNotFoundError, match="gives 64 x 48 px, the configuration wants 640 x 480"
    ):
        device(width_px=640, height_px=480)


def test_slow_reader_gets_the_newest_frame_and_the_rest_is_counted(device) -> None:
    camera = device()
    collect(camera, 3)
    threading.Event().wait(0.3)
    frame = camera.read(0.2)
    assert time.monotonic_ns() - frame.t_ns < 0.1e9
    assert camera.counters["overtaken"] > 10
    assert camera.counters["dropped"] > 10


def test_dead_device_is_opened_again(device) -> None:
    camera = device({"dies_at": 10})
    frames = collect(camera, 30)
    assert len(frames) == 30
    assert camera.counters["restarts"] == 1
    assert camera.capture.opened == 2
    told = [e.level for e in camera.take_events() if "=" not in e.message]
    assert told == ["warning", "info"]


def test_last_frame_of_an_unplugged_device_is_no_return(device, node) -> None:
    camera = device({"dies_at": 10})
    node.unlink()
    # Left unread until the device is gone: the newest frame waits.
    give_up = time.monotonic() + 15
    while camera.capture.dies_at is not None and time.monotonic() < give_up:
        camera.capture.gate.wait(0.01)
    camera.capture.gate.wait(0.1)
    assert len(collect(camera, 1)) == 1
    told = [e.message for e in camera.take_events() if "=" not in e.message]
    assert told == ["reading failed; opening it again"]
    node.touch()
    assert len(collect(camera, 5)) == 5
    assert "frames again" in [e.message for e in camera.take_events()]


def test_frozen_picture_reopens_the_device(device) -> None:
    camera = device({"stands_still": True})
    give_up = time.monotonic() + 15
    while camera.capture.opened < 2 and time.monotonic() < give_up:
        camera.read(0.05)
    assert camera.counters["frozen"] == 1
    assert any(e.message.startswith("the picture is frozen") for e in camera.take_events())
