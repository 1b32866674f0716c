"""What the simulated camera sees, fed to whoever takes frames."""

import threading
from typing import Final, Protocol

from drivers.clock import Clock
from drivers.samples import Frame
from sim_bus.camera.sim_camera import SimCamera

IDLE_NS: Final = 50_000_000


class FrameSink(Protocol):
    """Takes the frames of the simulated camera."""

    @property
    def is_watched(self) -> bool:
        """Whether anybody looks: nothing needs to be painted otherwise."""
        ...

    @property
    def counters(self) -> dict[str, int]:
        """Frames that went out, and that did not."""
        ...

    def send(self, frame: Frame) -> None:
        """Take a frame."""
        ...

    def close(self) -> None:
        """End; may be called twice."""
        ...


class Feeder:
    """Paints frames from its own thread while somebody looks."""

    def __init__(self, camera: SimCamera, sink: FrameSink, clock: Clock) -> None:
        self._camera, self._sink, self._clock = camera, sink, clock
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._feed, name="camera", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End; may be called twice."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def _feed(self) -> None:
        while not self._stop.is_set():
            if not self._sink.is_watched:
                now_ns = self._clock.now_ns()
                for _ in self._camera.take_exposures(now_ns):
                    pass
                self._stop.wait(IDLE_NS * 1e-9)
                continue
            frame = self._camera.read(0.1)
            if frame is not None:
                self._sink.send(frame)
