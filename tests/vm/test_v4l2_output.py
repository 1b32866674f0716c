"""What `rig serve --camera v4l2` writes reaches our camera driver: vivid's output to its input."""

import threading
import time

import numpy as np
import pytest

from drivers.cameras.v4l2 import V4l2Camera
from drivers.clock import SteadyClock
from drivers.samples import Frame
from sim_bus.bench.v4l2_output import V4l2Output
from tests.vm import vivid

pytestmark = pytest.mark.vm

CAPTURE, OUTPUT = "/dev/video0", "/dev/video1"
WIDTH, HEIGHT = 640, 480


@pytest.fixture
def looped() -> None:
    """An HDMI input that is fed by an HDMI output, in the pixel format that OpenCV asks for."""
    vivid.load(
        node_types="0x101", num_inputs="1", input_types="3", num_outputs="1", output_types="1",
        vid_cap_nr="0", vid_out_nr="1",
    )  # fmt: skip
    for device in (CAPTURE, OUTPUT):
        vivid.tell(device, "--set-dv-bt-timings", "index=0")  # 640 x 480, 59.94 Hz
    vivid.tell(OUTPUT, "--set-fmt-video-out", f"width={WIDTH},height={HEIGHT},pixelformat=BGR3")
    vivid.tell(CAPTURE, "-c", "loop_video=1,osd_text_mode=2,timestamp_source=1")


def picture(number: int) -> np.ndarray:
    """A field whose brightness is its number, with a spot that must stay where it is."""
    image = np.full((HEIGHT, WIDTH), number % 200, dtype=np.uint8)
    image[100:110, 200:220] = 255
    return image


def test_served_frames_arrive_whole_and_in_order(looped, record_property) -> None:
    output = V4l2Output(OUTPUT, WIDTH, HEIGHT)
    stop = threading.Event()
    sent_ns: list[int] = []

    def feed() -> None:
        while not stop.wait(0.05):
            number = len(sent_ns)
            sent_ns.append(time.monotonic_ns())
            output.send(Frame(sent_ns[-1], "root", number, picture(number)))

    feeder = threading.Thread(target=feed)
    feeder.start()
    camera = V4l2Camera(CAPTURE, SteadyClock(), width_px=WIDTH, height_px=HEIGHT, fps=59.94)
    arrived: list[tuple[int, int]] = []
    give_up = time.monotonic() + 40
    try:
        while len({number for number, _ in arrived}) < 12 and time.monotonic() < give_up:
            frame = camera.read(0.5)
            # vivid shows noise until the output streams.
            if frame is not None and np.ptp(frame.image[:90]) == 0:
                arrived.append((int(frame.image[0, 0, 0]), frame.t_ns))
                assert np.array_equal(frame.image[..., 0], picture(arrived[-1][0]))
    finally:
        stop.set()
        feeder.join()
        camera.close()
        output.close()
    numbers = [number for number, _ in arrived]
    assert numbers == sorted(numbers)
    assert len(set(numbers)) >= 12
    latest_ms = [
        (t_ns - sent_ns[number]) * 1e-6
        for (number, t_ns), (before, _) in zip(arrived[1:], arrived, strict=False)
        if number != before
    ]
    record_property("sent_to_stamp_ms", float(np.median(latest_ms)))
    record_property("output_lost", output.lost)
    assert output.written >= 12
    assert np.median(latest_ms) > -1e3 / 59.94
