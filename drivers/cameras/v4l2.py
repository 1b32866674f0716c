"""``V4l2Camera``: a V4L2 device through OpenCV, with the kernel's monotonic stamps.

OpenCV's read blocks for seconds when a camera dies, so a thread of this driver does nothing but
read, and keeps the newest frame only.
"""

import os
import threading
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.cameras.v4l2_controls import turn_off_automatic_gain
from drivers.cameras.watch import FrameWatch
from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from drivers.events import Event, EventList, Level
from drivers.samples import Frame

DEAD_NS: Final = 2_000_000_000
RETRY_S: Final = 0.5
# OpenCV waits ten seconds for a silent camera. Later than DEAD_NS: silence is reported as such.
READ_TIMEOUT_S: Final = 3
# A stamp that far from now is no CLOCK_MONOTONIC of this machine.
OLDEST_NS, NEWEST_NS = 1_000_000_000, 100_000_000
_MANUAL_EXPOSURE: Final = 1  # V4L2_EXPOSURE_MANUAL
_EXPOSURE_STEP_US: Final = 100  # V4L2_CID_EXPOSURE_ABSOLUTE counts these

Capture = tuple[int, NDArray[np.uint8]]


class V4l2Camera:
    """A V4L2 device; a ``Source[Frame]`` that opens it again when it dies or freezes.

    Parameters
    ----------
    device : str
        Node, e.g. ``/dev/video0``.
    clock : Clock
        The steady clock.
    camera : str
        Name that the frames carry.
    width_px, height_px, fps : int, int, float
        Wanted mode; another one is an error, since the lens calibration belongs to it.
    exposure_us, gain, white_balance_k : int or None
        Fixed settings; automatic where None.
    stamp_to_middle_s : float
        From the buffer's stamp to the middle of its exposure, s.

    Attributes
    ----------
    settings : dict of str to float
        What the device reads back; a control that it lacks is absent.

    Raises
    ------
    DeviceNotFoundError
        If the device is missing or does not take the mode.
    """

    def __init__(
        self,
        device: str,
        clock: Clock,
        *,
        camera: str = "root",
        width_px: int = 640,
        height_px: int = 480,
        fps: float = 30.0,
        exposure_us: int | None = None,
        gain: int | None = None,
        white_balance_k: int | None = None,
        stamp_to_middle_s: float = 0.0,
    ) -> None:
        self.name = f"camera {camera}"
        self.settings: dict[str, float] = {}
        self._device = device
        self._clock = clock
        self._camera = camera
        self._size = (width_px, height_px)
        self._wanted = _controls(fps, exposure_us, gain, white_balance_k)
        self._shift_ns = round(stamp_to_middle_s * 1e9)
        self._events = EventList()
        self._watch = FrameWatch(fps)
        self.counters = self._watch.counters
        self._newest: deque[Capture] = deque(maxlen=1)
        self._has_frame = threading.Condition()
        self._stop = threading.Event()
        self._restart = threading.Event()
        self._heard_ns = clock.now_ns()
        self._is_failing = False
        capture = self._open()
        self._thread = threading.Thread(
            target=self._capture, args=(capture,), name=self.name, daemon=True
        )
        self._thread.start()

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest frame, None if none came within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while not self._stop.is_set():
            captured = self._take(max(0, deadline_ns - self._clock.now_ns()) * 1e-9)
            if captured is None:
                self._check_alive()
                return None
            t_ns, image = captured
            good = self._watch.is_good(t_ns, image)
            if self._watch.is_frozen(t_ns):
                self.counters["frozen"] += 1
                self._watch.expect_still_pictures()
                self._fail("the picture is frozen")
            if good:
                return Frame(t_ns, self._camera, self._watch.index, image)
        return None

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source."""
        return {self.name: dict(self.counters)}

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._events.take()

    def close(self) -> None:
        """End the capture; may be called twice."""
        self._stop.set()
        self._thread.join(timeout=1.0)

    def _open(self) -> cv2.VideoCapture:
        # OpenCV asks once in a process, at the first read.
        os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", str(READ_TIMEOUT_S))
        # OpenCV prints a warning about a node that is not there.
        capture = cv2.VideoCapture()
        if not Path(self._device).exists() or not capture.open(self._device, cv2.CAP_V4L2):
            msg = (
                f"{self.name}: {self._device} does not open; `ls /dev/video*` shows what is there, "
                "and the user must be in the group video"
            )
            raise DeviceNotFoundError(msg)
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size[1])
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 2)
        found = tuple(
            round(capture.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        )
        if found != self._size:
            capture.release()
            msg = (
                f"{self.name}: {self._device} gives {found[0]} x {found[1]} px, the configuration "
                f"wants {self._size[0]} x {self._size[1]}; set width_px and height_px to a mode of "
                "`v4l2-ctl --list-formats-ext`"
            )
            raise DeviceNotFoundError(msg)
        self._set_controls(capture)
        return capture

    def _set_controls(self, capture: cv2.VideoCapture) -> None:
        if "gain" in self._wanted:
            turn_off_automatic_gain(self._device)
        for name, (prop, value) in self._wanted.items():
            if not capture.set(prop, value):
                self._say("warning", f"{name} = {value:g} is refused: {self._device} has it not")
                continue
            found = float(capture.get(prop))
            self.settings[name] = found
            level: Level = "info" if abs(found - value) < 0.01 * max(abs(value), 1) else "warning"
            self._say(level, f"{name} = {value:g}, reads back {found:g}")

    def _capture(self, capture: cv2.VideoCapture | None) -> None:
        """Read for ever; the only code that touches the device after the start."""
        while not self._stop.is_set():
            if capture is None:
                self._stop.wait(RETRY_S)
                capture = self._reopen()
                continue
            is_read, image = capture.read()
            if not is_read or self._restart.is_set():
                if not is_read and not self._is_failing:
                    self._fail("reading failed")
                self._restart.clear()
                capture.release()
                capture = None
                continue
            stamp_ms = capture.get(cv2.CAP_PROP_POS_MSEC)
            self._put(round(stamp_ms * 1e6), np.asarray(image, dtype=np.uint8))
        if capture is not None:
            capture.release()

    def _reopen(self) -> cv2.VideoCapture | None:
        try:
            capture = self._open()
        except DeviceNotFoundError:
            return None
        self.counters["restarts"] += 1
        self._watch.restart()
        return capture

    def _put(self, stamp_ns: int, image: NDArray[np.uint8]) -> None:
        now_ns = self._clock.now_ns()
        if not now_ns - OLDEST_NS <= stamp_ns <= now_ns + NEWEST_NS:
            self.counters["stamped_by_arrival"] += 1
            stamp_ns = now_ns
        with self._has_frame:
            self.counters["overtaken"] += len(self._newest)
            self._newest.append((stamp_ns + self._shift_ns, image))
            self._has_frame.notify()
        if self._is_failing and not self._restart.is_set():
            self._is_failing = False
            self._say("info", "frames again")

    def _take(self, timeout_s: float) -> Capture | None:
        with self._has_frame:
            if not self._newest:
                self._has_frame.wait(timeout_s)
            if not self._newest:
                return None
            self._heard_ns = self._clock.now_ns()
            return self._newest.popleft()

    def _check_alive(self) -> None:
        silent_ns = self._clock.now_ns() - self._heard_ns
        if silent_ns > DEAD_NS and not self._is_failing:
            self.counters["dead"] += 1
            self._fail(f"no frame for {silent_ns * 1e-9:.1f} s")

    def _fail(self, why: str) -> None:
        self._is_failing = True
        self._restart.set()
        self._say("warning", f"{why}; opening it again")

    def _say(self, level: Level, message: str) -> None:
        self._events.add(self._clock.now_ns(), self.name, level, message)


def _controls(
    fps: float, exposure_us: int | None, gain: int | None, white_balance_k: int | None
) -> Mapping[str, tuple[int, float]]:
    """Return the properties to set, in order, by the name under which they are reported."""
    wanted: dict[str, tuple[int, float]] = {"fps": (cv2.CAP_PROP_FPS, fps)}
    if exposure_us is not None:
        wanted["exposure_mode"] = (cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL_EXPOSURE)
        wanted["exposure_100us"] = (cv2.CAP_PROP_EXPOSURE, exposure_us / _EXPOSURE_STEP_US)
    if gain is not None:
        wanted["gain"] = (cv2.CAP_PROP_GAIN, gain)
    if white_balance_k is not None:
        wanted["white_balance_mode"] = (cv2.CAP_PROP_AUTO_WB, 0)
        wanted["white_balance_k"] = (cv2.CAP_PROP_WB_TEMPERATURE, white_balance_k)
    return wanted
