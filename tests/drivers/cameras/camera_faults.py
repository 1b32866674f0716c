"""Faults of a camera behind a GStreamer child: what is injected, what is allowed, what happened."""

import json
import os
import stat
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np

from drivers.cameras import FrameProcess
from drivers.clock import SteadyClock

FAKE = Path(__file__).with_name("fake_gst_launch.py")
FPS = 50.0
HEALTHY = {"frames": 10_000}


@dataclass(frozen=True)
class CameraCase:
    """One fault; the child's first start has it, the next one is healthy."""

    kind: str
    script: dict[str, object]
    counter: str
    recovery_s: float
    expected: str


CASES = (
    CameraCase("child_killed", {"frames": 20}, "restarts", 3.0, "started again after 0.5 s"),
    CameraCase(
        "child_hangs", {"frames": 20, "hang": True}, "dead", 5.0, "killed after 2 s of silence"
    ),
    CameraCase(
        "picture_frozen", {"frames": 400, "frozen_from": 20}, "frozen", 5.0,
        "started again after 2 s of equal pictures",
    ),
    CameraCase("stream_garbage", {"frames": 3, "garbage": "deadbeef"}, "restarts", 3.0,
               "refused, started again"),
    CameraCase("first_frames_repeated", {"frames": 10_000, "same": [1, 2]}, "repeated_first", 0.5,
               "the repetitions are left out"),
    CameraCase("base_time_missing", {"frames": 10_000, "no_base": True}, "stamped_by_arrival", 0.5,
               "stamped by the earliest arrival"),
)  # fmt: skip


@dataclass(frozen=True)
class CameraOutcome:
    """Longest time without a new picture, and the counters."""

    recovery_s: float
    counters: dict[str, int]


def run(case: CameraCase) -> CameraOutcome:
    """Fly one case: 25 good frames after the fault."""
    with tempfile.TemporaryDirectory() as folder:
        launcher = Path(folder) / "gst-launch-1.0"
        launcher.write_text(f"#!/bin/sh\nexec {sys.executable} {FAKE}\n", encoding="ascii")
        launcher.chmod(launcher.stat().st_mode | stat.S_IXUSR)
        changes = {
            "PATH": f"{folder}:{os.environ['PATH']}",
            "FAKE_GST": json.dumps([case.script, HEALTHY]),
            "FAKE_GST_STARTS": str(Path(folder) / "starts"),
        }
        with mock.patch.dict(os.environ, changes):
            camera = FrameProcess("videotestsrc", SteadyClock(), fps=FPS)
            try:
                return _run(camera, case)
            finally:
                camera.close()


def _run(camera: FrameProcess, case: CameraCase) -> CameraOutcome:
    new_ns = [time.monotonic_ns()]
    picture, after = b"", 0
    give_up = time.monotonic() + 30.0
    while after < 25 and time.monotonic() < give_up:
        frame = camera.read(0.2)
        if frame is None:
            continue
        if frame.image.tobytes() != picture:
            picture = frame.image.tobytes()
            new_ns.append(time.monotonic_ns())
        after += camera.counters[case.counter] > 0
    gaps_s = np.diff(new_ns[1:] if case.kind != "stream_garbage" else new_ns) * 1e-9
    return CameraOutcome(float(gaps_s.max()), dict(camera.counters))
