"""A recorded video as a camera that plays at its own rate."""

import os
from collections import Counter
from pathlib import Path

import cv2
import numpy as np

from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from drivers.events import Event, EventList
from drivers.samples import Frame


def open_video(path: Path) -> cv2.VideoCapture | None:
    """Return an open video, or None if OpenCV cannot read it."""
    # What is wrong with a file is ours to say; FFmpeg would print lines of its own before.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    capture = cv2.VideoCapture(str(path))
    return capture if capture.isOpened() else None


class VideoFile:
    """A video file; a ``Source[Frame]`` that ends with the file.

    Parameters
    ----------
    path : Path
        The file.
    clock : Clock
        The steady clock; frame n is due ``n / fps`` after the first read.
    camera : str
        Name that the frames carry.
    fps : float or None
        Frame rate, 1/s; None = the file's own.

    Raises
    ------
    DeviceNotFoundError
        If the file is missing or no video.
    """

    def __init__(
        self, path: Path, clock: Clock, *, camera: str = "root", fps: float | None = None
    ) -> None:
        self.name = f"camera {camera}"
        if not path.is_file():
            msg = f"{self.name}: {path} does not exist; give the path of a video file"
            raise DeviceNotFoundError(msg)
        capture = open_video(path)
        if capture is None:
            msg = f"{self.name}: {path} is not a video that OpenCV can read"
            raise DeviceNotFoundError(msg)
        self._capture = capture
        self.fps = fps or self._capture.get(cv2.CAP_PROP_FPS) or 30.0
        self.counters: Counter[str] = Counter()
        self._path = path
        self._clock = clock
        self._camera = camera
        self._events = EventList()
        self._start_ns: int | None = None
        self._index = 0
        self.is_over = False

    @property
    def next_ns(self) -> int:
        """When the next frame is due, ns of the steady clock."""
        if self._start_ns is None:
            self._start_ns = self._clock.now_ns()
        return self._start_ns + round(self._index * 1e9 / self.fps)

    def read(self, timeout_s: float) -> Frame | None:
        """Return the next frame, None if it is not due within ``timeout_s`` or the file is over."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        if self.is_over or self.next_ns > deadline_ns:
            self._clock.sleep_until_ns(deadline_ns)
            return None
        t_ns = self.next_ns
        self._clock.sleep_until_ns(t_ns)
        is_read, image = self._capture.read()
        if not is_read:
            self.is_over = True
            text = f"{self._path}: over after {self._index} frames"
            self._events.add(self._clock.now_ns(), self.name, "info", text)
            return None
        index, self._index = self._index, self._index + 1
        self.counters["frames"] += 1
        return Frame(t_ns, self._camera, index, np.asarray(image, dtype=np.uint8))

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source."""
        return {self.name: dict(self.counters)}

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        return self._events.take()

    def close(self) -> None:
        """Release the file; may be called twice."""
        self.is_over = True
        self._capture.release()
