"""Cameras: the stream's form, stamps, repeated and frozen pictures, dead children, video files."""

import json
import os
import random
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.cameras import FrameProcess, V4l2Camera, VideoFile, jetson_csi_line
from drivers.cameras.gdp import GdpParser
from drivers.cameras.watch import FrameWatch
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError, FrameFormatError
from sim_bus.clock import SimClock
from tests.drivers.cameras.fake_gst_launch import packet, picture
from tests.drivers.wing_bench import SECOND

FAKE = Path(__file__).with_name("fake_gst_launch.py")


@pytest.fixture
def gst(monkeypatch, tmp_path):
    """Return a call that opens a ``FrameProcess`` on a scripted stand-in of gst-launch."""
    launcher = tmp_path / "bin" / "gst-launch-1.0"
    launcher.parent.mkdir()
    launcher.write_text(f"#!/bin/sh\nexec {sys.executable} {FAKE}\n", encoding="ascii")
    launcher.chmod(launcher.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{launcher.parent}:{os.environ['PATH']}")
    opened = []

    def start(fps: float = 50.0, **script) -> FrameProcess:
        monkeypatch.setenv("FAKE_GST", json.dumps(script))
        opened.append(FrameProcess("videotestsrc", SteadyClock(), camera="root", fps=fps))
        return opened[-1]

    yield start
    for camera in opened:
        camera.close()
        camera.close()


def collect(camera, count: int, limit_s: float = 20.0):
    frames, give_up = [], time.monotonic() + limit_s
    while len(frames) < count and time.monotonic() < give_up:
        frame = camera.read(0.2)
        if frame is not None:
            frames.append(frame)
    return frames


def test_child_frames_have_exact_stamps_and_pictures(gst) -> None:
    camera = gst(frames=200, period_s=0.05, fps=20.0)
    camera.open()
    before_ns = time.monotonic_ns() - 2 * SECOND
    frames = collect(camera, 10)
    assert len(frames) == 10
    assert [f.index for f in frames] == sorted({f.index for f in frames})
    assert frames[0].image.shape == (8, 31, 3)
    numbers = [int(f.image[0, 0, 0]) for f in frames]
    assert numbers == sorted(set(numbers))
    for number, frame in zip(numbers, frames, strict=True):
        assert frame.image[0, 0].tolist() == [number, number + 1, number + 2]
    assert all(before_ns < f.t_ns <= time.monotonic_ns() for f in frames)
    assert camera.counters["stamped_by_arrival"] == 0


def test_without_base_time_the_earliest_arrival_serves(gst) -> None:
    camera = gst(frames=200, no_base=True)
    frames = collect(camera, 10)
    assert camera.counters["stamped_by_arrival"] >= 10
    assert abs(frames[-1].t_ns - time.monotonic_ns()) < 0.5 * SECOND


def test_repeated_first_frames_are_rejected(gst) -> None:
    camera = gst(frames=200, same=[1, 2])
    numbers = [int(f.image[0, 0, 0]) for f in collect(camera, 6)]
    assert camera.counters["repeated_first"] == 2
    assert numbers == sorted(set(numbers))
    assert not {1, 2} & set(numbers)


@pytest.mark.parametrize("height", [8, 5000], ids=["all waits in the pipe", "pipe fills up"])
def test_after_a_stall_the_newest_frame_comes_and_the_others_count(gst, height) -> None:
    # GIVEN a camera of 50 frames a second WHEN the reader stalls for longer than any stamp's limit
    camera = gst(frames=2000, height=height)
    first = collect(camera, 5)[-1]
    dropped = camera.counters["dropped"]
    time.sleep(2.5)
    # THEN the next frame is a new one, and those before it are counted
    frame = camera.read(1.0)
    age_s = (time.monotonic_ns() - frame.t_ns) * 1e-9
    assert age_s < 0.3
    assert camera.counters["dropped"] - dropped == frame.index - first.index - 1 > 50
    assert camera.counters["overtaken"] > 0
    assert camera.counters["stamped_by_arrival"] == camera.counters["backward"] == 0
    assert camera.take_events() == []


def test_dead_child_is_started_again_and_told_once(gst) -> None:
    camera = gst(frames=4)  # and then it ends, every time
    frames = collect(camera, 10)
    assert len(frames) == 10
    assert camera.counters["restarts"] >= 2
    indices = [f.index for f in frames]
    assert indices == sorted(set(indices))
    levels = [e.level for e in camera.take_events()]
    assert levels[:2] == ["warning", "info"]


def test_garbage_in_the_stream_restarts_the_child(gst) -> None:
    camera = gst(frames=3, garbage="deadbeef")
    assert camera.read(2.0) is None
    assert camera.counters["restarts"] >= 1
    assert "expected 0100" in camera.take_events()[0].message


def test_what_gstreamer_complains_about_is_in_the_error(gst) -> None:
    camera = gst(complain="no element nvarguscamerasrc")
    with pytest.raises(DeviceNotFoundError, match=r"camera root: no frame .*nvarguscamerasrc"):
        camera.open(timeout_s=3.0)


def test_missing_gstreamer_is_named_with_its_packages(monkeypatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(DeviceNotFoundError, match=r"apt install gstreamer1.0-tools"):
        FrameProcess("videotestsrc", SteadyClock())


def test_child_dies_with_its_killed_parent(tmp_path) -> None:
    code = (
        "import sys, time\n"
        "from drivers.cameras.child import start_child\n"
        "child = start_child([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        parent.send_signal(signal.SIGKILL)
    give_up = time.monotonic() + 10
    while time.monotonic() < give_up:
        state = Path(f"/proc/{child}/stat")
        if (
            not state.exists()
            or state.read_text(encoding="ascii").rsplit(")", 1)[1].split()[0] == "Z"
        ):
            return
        time.sleep(0.02)
    pytest.fail("the child outlived its parent")


def test_csi_line_fixes_exposure_and_gain() -> None:
    line = jetson_csi_line(sensor_id=1, width_px=640, height_px=480, exposure_us=2000, gain=4)
    assert 'sensor-id=1 exposuretimerange="2000000 2000000"' in line
    assert 'gainrange="4 4"' in line
    assert "width=640,height=480,framerate=30000/1000,format=NV12" in line


@pytest.mark.parametrize(
    ("settings", "number"),
    [
        ({}, 1),
        ({"exposure_us": 2000}, 0),
        ({"white_balance": "daylight"}, 5),
        ({"exposure_us": 2000, "white_balance": "auto"}, 1),
    ],
)
def test_csi_line_says_the_white_balance(settings, number: int) -> None:
    assert f" wbmode={number} !" in jetson_csi_line(**settings)


def gdp_stream() -> bytes:
    caps = b"video/x-raw, width=(int)31, height=(int)8, format=(string)BGR\0"
    return packet(2, caps) + b"".join(packet(1, picture(n), n * 1000) for n in range(20))


def test_stream_is_put_together_from_any_pieces() -> None:
    rng, stream, parser = random.Random(1), gdp_stream(), GdpParser()
    frames, at = [], 0
    while at < len(stream):
        step = rng.choice([1, 7, 62, 900, 5000])
        assert parser.missing >= 1
        frames += parser.feed(stream[at : at + step])
        at += step
    assert [f.pts_ns for f in frames] == [n * 1000 for n in range(20)]


def test_corrupted_stream_is_refused_or_gives_the_pictures_sent() -> None:
    """Up to three wrong bytes: an error, or pictures of the right size wrong in as many bytes."""
    rng, stream = random.Random(2), gdp_stream()
    sent = np.array([frame.image for frame in GdpParser().feed(stream)])
    refused = 0
    for _ in range(300):
        broken = bytearray(stream)
        wrong = rng.randrange(1, 4)
        for _ in range(wrong):
            broken[rng.randrange(2000)] = rng.randrange(256)
        try:
            for frame in GdpParser().feed(bytes(broken)):
                assert frame.image.shape == (8, 31, 3)
                assert (frame.image != sent).sum(axis=(1, 2, 3)).min() <= wrong
        except FrameFormatError:
            refused += 1
    assert refused > 5


@pytest.mark.parametrize("wrong", [b"height=(int)e", b"height=(int)0", b"h_ight=(int)8"])
def test_format_without_a_size_is_refused(wrong: bytes) -> None:
    stream = gdp_stream().replace(b"height=(int)8", wrong)
    with pytest.raises(FrameFormatError, match="expected video/x-raw in BGR or GRAY8"):
        list(GdpParser().feed(stream))


def test_picture_of_wrong_size_is_refused() -> None:
    stream = gdp_stream().replace(b"height=(int)8", b"height=(int)9")
    with pytest.raises(FrameFormatError, match="picture of 768 bytes, expected 864 for 31 x 9"):
        list(GdpParser().feed(stream))


def image(number: int) -> np.ndarray:
    return np.full((16, 16), number % 256, dtype=np.uint8)


def test_gap_in_the_stamps_is_counted_and_shows_in_the_index() -> None:
    watch = FrameWatch(fps=30.0)
    indices = []
    for k in (0, 1, 2, 5, 6):
        assert watch.is_good(SECOND + round(k * SECOND / 30), image(k))
        indices.append(watch.index)
    assert indices == [0, 1, 2, 5, 6]
    assert watch.counters["dropped"] == 2


def test_stamp_that_runs_backwards_is_refused() -> None:
    watch = FrameWatch(fps=30.0)
    assert watch.is_good(SECOND, image(0))
    assert not watch.is_good(SECOND, image(1))
    assert watch.counters["backward"] == 1


def test_frozen_picture_is_seen_after_two_seconds_and_then_after_four() -> None:
    watch, t_ns, verdicts = FrameWatch(fps=30.0), 0, []
    for k in range(300):
        t_ns += SECOND // 30
        watch.is_good(t_ns, image(min(k, 20)))
        if watch.is_frozen(t_ns):
            verdicts.append(t_ns)
            watch.expect_still_pictures()
            watch.restart()
    frozen_ns = 21 * SECOND // 30
    assert verdicts[0] - frozen_ns == pytest.approx(2 * SECOND, rel=0.1)
    assert verdicts[1] - verdicts[0] == pytest.approx(4 * SECOND, rel=0.1)


@pytest.fixture
def video(tmp_path) -> Path:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for k in range(10):
        writer.write(np.full((48, 64, 3), 20 * k, dtype=np.uint8))
    writer.release()
    return path


def test_video_file_plays_at_its_own_rate_and_ends(video) -> None:
    clock = SimClock(SECOND)
    with_all = VideoFile(video, clock)
    frames = [frame for _ in range(12) if (frame := with_all.read(0.04)) is not None]
    assert [f.index for f in frames] == list(range(10))
    assert np.diff([f.t_ns for f in frames]) == pytest.approx(40_000_000)
    assert frames[5].image.mean() == pytest.approx(100, abs=3)
    assert with_all.is_over
    assert [e.level for e in with_all.take_events()] == ["info"]
    with_all.close()
    with_all.close()


def test_frame_that_is_not_due_is_not_returned(video) -> None:
    clock = SimClock(SECOND)
    camera = VideoFile(video, clock)
    assert camera.read(0) is not None
    assert camera.read(0) is None
    clock.advance(40_000_000)
    assert camera.read(0) is not None


def test_missing_and_foreign_files_are_named(tmp_path) -> None:
    with pytest.raises(DeviceNotFoundError, match="does not exist"):
        VideoFile(tmp_path / "none.avi", SimClock())
    empty = tmp_path / "empty.avi"
    empty.write_bytes(b"not a video")
    with pytest.raises(DeviceNotFoundError, match="is not a video"):
        VideoFile(empty, SimClock())


def test_missing_v4l2_device_is_named() -> None:
    with pytest.raises(DeviceNotFoundError, match=r"/dev/video99 does not open; .*group video"):
        V4l2Camera("/dev/video99", SteadyClock())
