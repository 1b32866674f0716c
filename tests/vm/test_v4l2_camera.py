"""``V4l2Camera`` on a real V4L2 device of the kernel: vivid in the virtual machine."""

import statistics
import threading
import time
from pathlib import Path

import pytest

from drivers.cameras.v4l2 import V4l2Camera
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError
from tests.vm import vivid

pytestmark = pytest.mark.vm

DEVICE, OUTPUT = "/dev/video0", "/dev/video1"
FPS = 30.0
PERIOD_NS = 1e9 / FPS


@pytest.fixture(scope="module", autouse=True)
def camera_of_the_kernel() -> None:
    """A webcam, and an output device that is none."""
    vivid.load(node_types="0x101", num_inputs="1", input_types="0", vid_cap_nr="0", vid_out_nr="1")


@pytest.fixture
def make_camera():
    opened: list[V4l2Camera] = []

    def make(**options) -> V4l2Camera:
        wanted = {"width_px": 320, "height_px": 180, "fps": FPS, **options}
        opened.append(V4l2Camera(DEVICE, SteadyClock(), **wanted))
        return opened[-1]

    yield make
    for camera in opened:
        camera.close()


def collect(camera, count: int, limit_s: float = 20.0):
    """Return frames with the age that each had when it was read, ns."""
    frames, give_up = [], time.monotonic() + limit_s
    while len(frames) < count and time.monotonic() < give_up:
        frame = camera.read(0.5)
        if frame is not None:
            frames.append((frame, time.monotonic_ns() - frame.t_ns))
    return frames


def messages(camera, level: str) -> list[str]:
    return [event.message for event in camera.take_events() if event.level == level]


def test_frames_come_at_the_rate_with_the_kernels_stamps(make_camera, record_property) -> None:
    camera = make_camera()
    frames = [frame for frame, _ in collect(camera, 60)]
    assert len(frames) == 60
    assert frames[0].image.shape == (180, 320, 3)
    stamps = [frame.t_ns for frame in frames]
    assert stamps == sorted(set(stamps))
    assert camera.counters["stamped_by_arrival"] == 0
    passed = frames[-1].index - frames[0].index
    rate = passed / ((stamps[-1] - stamps[0]) * 1e-9)
    record_property("rate_hz", rate)
    record_property("share_received", (len(frames) - 1) / passed)
    assert rate == pytest.approx(FPS, rel=0.1)
    assert camera.settings["fps"] == FPS
    # Every number that is absent was counted.
    assert passed - (len(frames) - 1) == camera.counters["dropped"]


def test_middle_of_exposure_is_the_same_from_either_stamp(make_camera, record_property) -> None:
    """vivid stamps the start of a frame, or its end, which it puts at nine tenths of the period."""
    ages_ms = {}
    for source, to_middle in ((1, 0.5), (0, 0.5 - 0.9)):
        vivid.tell(DEVICE, "-c", f"timestamp_source={source}")
        for shift_s in (0.0, to_middle / FPS):
            camera = make_camera(stamp_to_middle_s=shift_s)
            ages = [age * 1e-6 for _, age in collect(camera, 30)[5:]]
            assert camera.counters["stamped_by_arrival"] == 0
            camera.close()
            # The least delayed ones: a busy host holds up the others.
            ages_ms[source, shift_s != 0] = statistics.quantiles(ages, n=10)[0]
    vivid.tell(DEVICE, "-c", "timestamp_source=0")
    record_property("age_of_start_ms", ages_ms[1, False])
    record_property("age_of_end_ms", ages_ms[0, False])
    assert ages_ms[1, False] - ages_ms[0, False] == pytest.approx(0.9e-6 * PERIOD_NS, abs=12)
    assert ages_ms[1, True] == pytest.approx(ages_ms[0, True], abs=12)
    assert ages_ms[1, False] > 0


def test_fixed_gain_holds_although_the_device_began_automatic(make_camera) -> None:
    vivid.tell(DEVICE, "-c", "gain_automatic=1")
    camera = make_camera(gain=42)
    assert camera.settings["gain"] == 42
    assert vivid.control(DEVICE, "gain_automatic") == 0
    assert vivid.control(DEVICE, "gain") == 42
    assert messages(camera, "warning") == []


def test_control_that_the_device_lacks_is_said(make_camera) -> None:
    camera = make_camera(exposure_us=2000, white_balance_k=5000)
    told = " | ".join(messages(camera, "warning"))
    for name in ("exposure_mode = 1", "exposure_100us = 20", "white_balance_k = 5000"):
        assert f"{name} is refused: {DEVICE} has it not" in told
    assert "exposure_100us" not in camera.settings
    assert len(collect(camera, 3)) == 3


def test_buffers_that_the_device_drops_are_counted(make_camera, record_property) -> None:
    vivid.tell(DEVICE, "-c", "percentage_of_dropped_buffers=40")
    camera = make_camera()
    frames = [frame for frame, _ in collect(camera, 60)]
    vivid.tell(DEVICE, "-c", "percentage_of_dropped_buffers=0")
    counters = dict(camera.counters)
    passed = frames[-1].index - frames[0].index
    # What the reader was too late for is lost as well; the rest is the device's.
    lost = counters["dropped"] - counters.get("overtaken", 0)
    record_property("lost_share", lost / passed)
    assert passed - (len(frames) - 1) == counters["dropped"]
    assert 0.25 < lost / passed < 0.6


def test_slow_reader_gets_the_newest_frame(make_camera) -> None:
    camera = make_camera()
    collect(camera, 3)
    threading.Event().wait(1.0)
    ((_, age),) = collect(camera, 1)
    assert age < 0.25e9
    assert camera.counters["overtaken"] >= 10
    assert camera.counters["dropped"] >= camera.counters["overtaken"]


def test_silent_device_is_found_dead_and_opened_again(make_camera, record_property) -> None:
    camera = make_camera()
    collect(camera, 3)
    camera.take_events()
    vivid.tell(DEVICE, "-c", "percentage_of_dropped_buffers=100")
    start = time.monotonic()
    while not camera.counters["restarts"] and time.monotonic() < start + 20:
        camera.read(0.3)
    record_property("opened_again_after_s", time.monotonic() - start)
    assert camera.counters["dead"] == 1
    assert time.monotonic() - start < 8  # OpenCV alone would wait for ten
    vivid.tell(DEVICE, "-c", "percentage_of_dropped_buffers=0")
    assert len(collect(camera, 10)) == 10
    told = [event.message for event in camera.take_events() if "=" not in event.message]
    assert [text[:13] for text in told] == ["no frame for ", "frames again"]


def test_camera_that_lost_contact_is_opened_again(make_camera, record_property) -> None:
    camera = make_camera()
    collect(camera, 3)
    camera.take_events()
    start = time.monotonic()
    vivid.tell(DEVICE, "-c", "disconnect=1")  # until the last user has closed it
    give_up = start + 20
    while not camera.counters["restarts"] and time.monotonic() < give_up:
        camera.read(0.2)
    assert len(collect(camera, 10)) == 10
    record_property("return_s", time.monotonic() - start)
    assert camera.counters["restarts"] == 1
    told = [event.message for event in camera.take_events() if "=" not in event.message]
    assert told == ["reading failed; opening it again", "frames again"]


def test_unplugged_camera_returns_when_plugged_in_again(make_camera, record_property) -> None:
    camera = make_camera(gain=42)
    collect(camera, 3)
    camera.take_events()
    vivid.unplug()
    assert not Path(DEVICE).exists()
    give_up = time.monotonic() + 20
    while camera.read(0.5) is not None and time.monotonic() < give_up:
        pass  # what came before
    assert camera.read(1.0) is None
    assert camera.counters["restarts"] == 0
    vivid.plug_in()
    start = time.monotonic()
    assert len(collect(camera, 10)) == 10
    record_property("return_s", time.monotonic() - start)
    assert camera.counters["restarts"] == 1
    assert vivid.control(DEVICE, "gain") == 42  # the device forgot it, the driver did not
    told = [event.message for event in camera.take_events() if "=" not in event.message]
    assert told == ["reading failed; opening it again", "frames again"]


def test_absent_node_and_wrong_mode_are_said_in_words(make_camera) -> None:
    with pytest.raises(DeviceNotFoundError, match="/dev/video9 does not open"):
        V4l2Camera("/dev/video9", SteadyClock())
    with pytest.raises(DeviceNotFoundError, match=f"{OUTPUT} does not open"):
        V4l2Camera(OUTPUT, SteadyClock())
    with pytest.raises(DeviceNotFoundError, match="the configuration wants 400 x 300"):
        make_camera(width_px=400, height_px=300)
    assert len(collect(make_camera(), 1)) == 1
