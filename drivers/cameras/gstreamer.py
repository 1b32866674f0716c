"""``FrameProcess``: a GStreamer pipeline in a child process, its frames through a pipe.

A child, because the published OpenCV wheels are built without GStreamer and because a camera
stack that hangs can be killed. Each buffer's time is its presentation stamp plus the pipeline's
base time, which the child reports on its error output: both are CLOCK_MONOTONIC.
"""

import contextlib
import fcntl
import os
import re
import select
import shlex
import shutil
import subprocess
from typing import Final

from drivers.cameras.child import start_child
from drivers.cameras.gdp import GdpFrame, GdpParser
from drivers.cameras.newest import NewestFrame
from drivers.cameras.watch import FrameWatch
from drivers.clock import Clock
from drivers.errors import BusError, DeviceNotFoundError, FrameFormatError
from drivers.events import Event, EventList, Level
from drivers.samples import Frame

PIPE_BYTES: Final = 1 << 20
START_TIMEOUT_NS: Final = 15_000_000_000
DEAD_NS: Final = 2_000_000_000
RETRY_NS: Final = 500_000_000
# How old a frame may be when it arrives; Argus takes 60 ms at 12 MP.
OLDEST_NS, NEWEST_NS = 2_000_000_000, 50_000_000
_BASE_TIME: Final = re.compile(rb"base_time[= ](\d+):(\d\d):(\d\d)\.(\d{9})")
# By nvarguscamerasrc's number (wbmode); 9, manual, is left out.
JETSON_WHITE_BALANCE: Final = (
    "off", "auto", "incandescent", "fluorescent", "warm-fluorescent", "daylight",
    "cloudy-daylight", "twilight", "shade",
)  # fmt: skip
_TAIL: Final = "! queue leaky=downstream max-size-buffers=1 ! gdppay ! fdsink fd=1 sync=false"


def jetson_csi_line(
    *,
    sensor_id: int = 0,
    width_px: int = 1280,
    height_px: int = 720,
    fps: float = 30.0,
    exposure_us: int | None = None,
    gain: float | None = None,
    white_balance: str | None = None,
) -> str:
    """Return the pipeline of a Jetson's CSI camera, up to raw video.

    Parameters
    ----------
    sensor_id : int
        CSI port.
    width_px, height_px, fps : int, int, float
        Mode of the sensor.
    exposure_us : int or None
        Fixed exposure, us; automatic if None.
    gain : float or None
        Fixed analogue gain; automatic if None.
    white_balance : str or None
        One of ``JETSON_WHITE_BALANCE``; None is "off" with a fixed exposure, otherwise "auto".
    """
    if white_balance is None:
        white_balance = "auto" if exposure_us is None else "off"
    options = f"sensor-id={sensor_id}"
    if exposure_us is not None:
        options += f' exposuretimerange="{exposure_us * 1000} {exposure_us * 1000}"'
    if gain is not None:
        options += f' gainrange="{gain:g} {gain:g}" ispdigitalgainrange="1 1"'
    options += f" wbmode={JETSON_WHITE_BALANCE.index(white_balance)}"
    mode = f"width={width_px},height={height_px},framerate={round(fps * 1000)}/1000,format=NV12"
    return (
        f"nvarguscamerasrc {options} ! video/x-raw(memory:NVMM),{mode} ! nvvidconv ! "
        "video/x-raw,format=BGRx ! videoconvert ! video/x-raw,format=BGR"
    )


class FrameProcess:
    """Frames of a GStreamer child; a ``Source[Frame]`` that starts a dead child again.

    Parameters
    ----------
    pipeline : str
        Description up to raw video in BGR or GRAY8, as for ``gst-launch-1.0``.
    clock : Clock
        The steady clock.
    camera : str
        Name that the frames carry.
    fps : float
        Nominal frame rate, 1/s.
    stamp_to_middle_s : float
        From the buffer's stamp to the middle of its exposure, s; -exposure / 2 where the stamp is
        the start of the read-out.

    Raises
    ------
    DeviceNotFoundError
        If ``gst-launch-1.0`` is not installed.
    """

    def __init__(
        self,
        pipeline: str,
        clock: Clock,
        *,
        camera: str = "root",
        fps: float = 30.0,
        stamp_to_middle_s: float = 0.0,
    ) -> None:
        self.name = f"camera {camera}"
        program = shutil.which("gst-launch-1.0")
        if program is None:
            msg = (
                f"{self.name}: gst-launch-1.0 is not installed; apt install gstreamer1.0-tools "
                "gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-bad"
            )
            raise DeviceNotFoundError(msg)
        self._command = [program, "-q", *shlex.split(f"{pipeline} {_TAIL}")]
        self._clock = clock
        self._camera = camera
        self._shift_ns = round(stamp_to_middle_s * 1e9)
        self._events = EventList()
        self._watch = FrameWatch(fps)
        self.counters = self._watch.counters
        self._newest = NewestFrame(self._watch, clock)
        self._child: subprocess.Popen[bytes] | None = None
        self._retry_ns = 0
        self._is_failing = self._is_closed = False
        self._start()

    def open(self, timeout_s: float = 15.0) -> None:
        """Wait for the first frame.

        Raises
        ------
        DeviceNotFoundError
            If none came; the message holds GStreamer's own.
        """
        give_up_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while self._clock.now_ns() < give_up_ns and self._child is not None:
            frame = self.read(0.2)
            if frame is not None:
                self._newest.put(frame)
                return
        msg = f"{self.name}: no frame from GStreamer: {self._complaint or 'it printed no reason'}"
        raise DeviceNotFoundError(msg)

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest frame, None if none came within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        self._catch_up()
        while not self._newest.is_there and not self._is_closed:
            now_ns = self._clock.now_ns()
            if self._child is None and now_ns >= self._retry_ns:
                self._start()
            wait_ns = max(0, deadline_ns - now_ns)
            if self._child is None:
                self._clock.sleep_until_ns(min(deadline_ns, self._retry_ns))
            else:
                self._pump(wait_ns)
                self._check_alive()
                self._catch_up()
            if self._clock.now_ns() >= deadline_ns:
                break
        return self._newest.take()

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source."""
        return {self.name: dict(self.counters)}

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._events.take()

    def close(self) -> None:
        """End the child; may be called twice."""
        self._is_closed = True
        self._stop()

    def _start(self) -> None:
        try:
            self._child = start_child(
                self._command,
                environment={"GST_DEBUG": "pipeline:5", "GST_DEBUG_NO_COLOR": "1"},
            )
        except OSError as error:
            msg = f"{self.name}: {self._command[0]}: {error.strerror}"
            raise BusError(msg) from error
        assert self._child.stdout is not None
        assert self._child.stderr is not None
        self._out, self._err = self._child.stdout.fileno(), self._child.stderr.fileno()
        for descriptor in (self._out, self._err):
            os.set_blocking(descriptor, False)
        with contextlib.suppress(OSError):  # a small pipe is slower, no more
            fcntl.fcntl(self._out, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._parser = GdpParser()
        self._base_ns: int | None = None
        self._fits = False
        self._earliest_ns: int | None = None
        self._said = b""
        self._complaint = ""
        self._watch.restart()
        self._heard_ns = self._clock.now_ns()
        self._has_frames = False

    def _stop(self) -> None:
        if self._child is None:
            return
        child, self._child = self._child, None
        child.kill()
        child.wait()
        for stream in (child.stdout, child.stderr):
            if stream is not None:
                stream.close()

    def _catch_up(self) -> None:
        self._newest.catch_up(self._pump, lambda: self._parser.is_midway)

    def _pump(self, wait_ns: int) -> int:
        """Wait for output of the child and take what there is; returns the bytes of frames."""
        if self._child is None:
            return 0
        wait_s = min(wait_ns, 200_000_000) * 1e-9
        readable, _, _ = select.select([self._out, self._err], [], [], wait_s)
        if self._err in readable:
            self._listen()
        if self._out not in readable:
            return 0
        # No more than this packet: of what follows a failure nothing is taken.
        data = os.read(self._out, min(self._parser.missing, PIPE_BYTES))
        if not data:
            self._listen()
            self._fail(f"the child ended: {self._complaint or 'no reason given'}")
        try:
            for frame in self._parser.feed(data):
                self._take(frame)
        except FrameFormatError as error:
            self._fail(str(error))
        return len(data)

    def _listen(self) -> None:
        """Read the child's error output: its base time and its error messages."""
        with contextlib.suppress(BlockingIOError):
            self._said = (self._said + os.read(self._err, 1 << 16))[-(1 << 16) :]
        for match in _BASE_TIME.finditer(self._said):
            hours, minutes, seconds, nanoseconds = (int(part) for part in match.groups())
            base_ns = ((hours * 60 + minutes) * 60 + seconds) * 10**9 + nanoseconds
            if base_ns:
                self._base_ns = base_ns
        errors = [
            line
            for line in self._said.decode(errors="replace").splitlines()
            if line.startswith(("ERROR", "WARNING: erroneous", "erroneous"))
        ]
        if errors:
            self._complaint = errors[0]

    def _take(self, frame: GdpFrame) -> None:
        now_ns = self._clock.now_ns()
        self._heard_ns = now_ns
        t_ns = self._steady(frame.pts_ns, now_ns) + self._shift_ns
        if not self._has_frames:
            self._has_frames = True
            if self._is_failing:
                self._is_failing = False
                self._say("info", "frames again")
        if self._watch.is_good(t_ns, frame.image):
            self._newest.put(Frame(t_ns, self._camera, self._watch.index, frame.image))
        if self._watch.is_frozen(t_ns):
            self.counters["frozen"] += 1
            self._watch.expect_still_pictures()
            self._fail("the picture is frozen")

    def _steady(self, pts_ns: int | None, now_ns: int) -> int:
        """Return the steady time of a stamp; by the earliest arrival where there is no base."""
        if pts_ns is None:
            self.counters["without_stamp"] += 1
            return now_ns
        if self._base_ns is not None:
            t_ns = self._base_ns + pts_ns
            # Once it has fitted, an old frame is one that a late reader has let wait.
            self._fits |= now_ns - OLDEST_NS <= t_ns <= now_ns + NEWEST_NS
            if self._fits and t_ns <= now_ns + NEWEST_NS:
                return t_ns
        self.counters["stamped_by_arrival"] += 1
        if self._earliest_ns is None or now_ns - pts_ns < self._earliest_ns:
            self._earliest_ns = now_ns - pts_ns
        return self._earliest_ns + pts_ns

    def _check_alive(self) -> None:
        if self._child is None:
            return
        silent_ns = self._clock.now_ns() - self._heard_ns
        if silent_ns > (DEAD_NS if self._has_frames else START_TIMEOUT_NS):
            self.counters["dead"] += 1
            self._fail(f"no frame for {silent_ns * 1e-9:.1f} s")

    def _fail(self, why: str) -> None:
        self.counters["restarts"] += 1
        if not self._is_failing:
            self._is_failing = True
            self._say("warning", f"{why}; starting it again")
        self._stop()
        self._retry_ns = self._clock.now_ns() + RETRY_NS

    def _say(self, level: Level, message: str) -> None:
        self._events.add(self._clock.now_ns(), self.name, level, message)
