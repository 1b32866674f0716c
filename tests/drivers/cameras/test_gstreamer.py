"""The GStreamer child with the real GStreamer: Jetson's line on stand-ins, stamps, death."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from drivers.cameras import FrameProcess, jetson_csi_line
from drivers.clock import SteadyClock

pytestmark = pytest.mark.gst
ELEMENTS = Path(__file__).with_name("gst_elements")
SECOND = 1_000_000_000


@pytest.fixture
def stand_ins(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("GST_PLUGIN_PATH", str(ELEMENTS))
    monkeypatch.setenv("GST_REGISTRY", str(tmp_path / "registry.bin"))


def frames_of(camera: FrameProcess, count: int, limit_s: float = 60.0):
    frames, ages_ns, give_up = [], [], time.monotonic() + limit_s
    while len(frames) < count and time.monotonic() < give_up:
        frame = camera.read(0.5)
        if frame is not None:
            frames.append(frame)
            ages_ns.append(time.monotonic_ns() - frame.t_ns)
    return frames, np.array(ages_ns)


def test_live_source_has_exact_stamps() -> None:
    line = (
        "videotestsrc is-live=true pattern=ball ! "
        "video/x-raw,width=322,height=240,framerate=30/1,format=BGR"
    )
    camera = FrameProcess(line, SteadyClock(), fps=30.0)
    camera.open(60.0)
    frames, ages_ns = frames_of(camera, 30)
    camera.close()
    assert frames[0].image.shape == (240, 322, 3)
    assert camera.counters["stamped_by_arrival"] == 0
    # The source's own clock makes the stamps: exactly a frame apart, whatever the arrival.
    steps_ns = np.diff([f.t_ns for f in frames]) / np.diff([f.index for f in frames])
    assert np.abs(steps_ns - SECOND / 30).max() < 100_000
    assert (ages_ns > 0).all()
    assert np.median(ages_ns) < 0.2 * SECOND


def test_jetsons_line_runs_unmodified_on_stand_ins(stand_ins) -> None:
    line = jetson_csi_line(
        width_px=640, height_px=480, exposure_us=2000, gain=4, white_balance="shade"
    )
    camera = FrameProcess(line, SteadyClock(), fps=30.0)
    camera.open(120.0)
    frames, _ = frames_of(camera, 10)
    camera.close()
    assert len(frames) == 10
    assert frames[0].image.shape == (480, 640, 3)


def test_killed_child_is_replaced_within_the_bound() -> None:
    line = (
        "videotestsrc is-live=true pattern=ball ! "
        "video/x-raw,width=320,height=240,framerate=30/1,format=GRAY8"
    )
    camera = FrameProcess(line, SteadyClock(), fps=30.0)
    camera.open(60.0)
    frames_of(camera, 5)
    assert camera._child is not None
    os.kill(camera._child.pid, signal.SIGKILL)
    frames, _ = frames_of(camera, 40)
    camera.close()
    gap_ns = max(np.diff([f.t_ns for f in frames]))
    assert len(frames) == 40
    assert gap_ns < 10 * SECOND
    assert [e.level for e in camera.take_events()] == ["warning", "info"]


def test_jetsons_stamps_lie_on_the_steady_clock(stand_ins) -> None:
    camera = FrameProcess(jetson_csi_line(width_px=320, height_px=240), SteadyClock(), fps=30.0)
    camera.open(120.0)
    frames, ages_ns = frames_of(camera, 20)
    camera.close()
    assert camera.counters["stamped_by_arrival"] == 0
    assert (ages_ns > 0).all()
    assert np.median(ages_ns) < SECOND
    steps_ns = np.diff([f.t_ns for f in frames]) / np.diff([f.index for f in frames])
    assert np.median(steps_ns) == pytest.approx(SECOND / 30, rel=0.1)


@pytest.mark.parametrize(
    ("source", "counter"),
    [
        ("videotestsrc is-live=true pattern=black", "frozen"),
        ("videotestsrc is-live=true pattern=ball num-buffers=15", "restarts"),
    ],
    ids=["frozen", "ended"],
)
def test_real_child_that_stops_delivering_is_started_again(source: str, counter: str) -> None:
    line = f"{source} ! video/x-raw,width=160,height=120,framerate=30/1,format=GRAY8"
    camera = FrameProcess(line, SteadyClock(), fps=30.0)
    camera.open(60.0)
    give_up = time.monotonic() + 60.0
    while not camera.counters[counter] and time.monotonic() < give_up:
        camera.read(0.2)
    counted = camera.counters[counter]
    camera.close()
    assert counted >= 1


def test_real_child_dies_with_its_parent() -> None:
    program = (
        "import sys, time\n"
        "from drivers.cameras import FrameProcess\n"
        "from drivers.clock import SteadyClock\n"
        "line = 'videotestsrc is-live=true ! video/x-raw,width=160,height=120,framerate=30/1'\n"
        "camera = FrameProcess(line + ',format=GRAY8', SteadyClock(), fps=30.0)\n"
        "camera.open(60.0)\n"
        "print(camera._child.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    try:
        child = Path("/proc") / parent.stdout.readline().strip()
        assert child.exists()
    finally:
        parent.kill()
        parent.communicate()
    give_up = time.monotonic() + 10.0
    while _runs(child) and time.monotonic() < give_up:
        time.sleep(0.02)
    assert not _runs(child)


def _runs(process: Path) -> bool:
    try:
        return (process / "stat").read_text().rsplit(")", 1)[1].split()[0] not in ("Z", "X")
    except OSError:
        return False
