"""What every live camera is watched for: repeated first pictures, a frozen one, lost ones."""

import zlib
from collections import Counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

# Some drivers deliver the first two or three frames from one exposure under several stamps.
FIRST_FRAMES: Final = 5
FROZEN_S: Final = 2.0


class FrameWatch:
    """Judges the frames of one live camera.

    Parameters
    ----------
    fps : float
        Nominal frame rate, 1/s; a gap in the stamps counts as lost frames.

    Attributes
    ----------
    counters : Counter of str
        ``frames``, ``dropped`` (gaps in the stamps), ``repeated_first``, ``repeated``,
        ``backward`` (stamps that did not advance; such frames are refused).
    period_ns : float
        Nominal time between frames, ns.
    """

    def __init__(self, fps: float) -> None:
        self.counters: Counter[str] = Counter()
        self.index = -1
        self.period_ns = 1e9 / fps
        self._frozen_ns = round(FROZEN_S * 1e9)
        self.restart()

    def restart(self) -> None:
        """Restart after the source was opened again; frame numbers continue."""
        self._since_start = 0
        self._still_since_ns: int | None = None
        self._print: int | None = None
        self._last_ns: int | None = None

    def is_good(self, t_ns: int, image: NDArray[np.uint8]) -> bool:
        """Take one frame; returns whether it is to be passed on under number ``index``."""
        if self._last_ns is not None and t_ns <= self._last_ns:
            self.counters["backward"] += 1
            return False
        fingerprint = zlib.crc32(image[::4, ::4].tobytes())
        is_repeat = fingerprint == self._print
        self._print = fingerprint
        self._since_start += 1
        if is_repeat and self._since_start <= FIRST_FRAMES:
            self.counters["repeated_first"] += 1
            return False
        self._watch_stillness(t_ns, is_repeat=is_repeat)
        lost = 0
        if self._last_ns is not None:
            lost = max(0, round((t_ns - self._last_ns) / self.period_ns) - 1)
        self.counters["dropped"] += lost
        self.counters["frames"] += 1
        self.index += lost + 1
        self._last_ns = t_ns
        return True

    def is_frozen(self, t_ns: int) -> bool:
        """Whether the picture has been the same, bit for bit, for too long."""
        return self._still_since_ns is not None and t_ns - self._still_since_ns > self._frozen_ns

    def expect_still_pictures(self) -> None:
        """Wait twice as long before the next restart: this one did not help."""
        self._frozen_ns *= 2

    def _watch_stillness(self, t_ns: int, *, is_repeat: bool) -> None:
        if is_repeat:
            self.counters["repeated"] += 1
            if self._still_since_ns is None:
                self._still_since_ns = t_ns
        else:
            if self._still_since_ns is not None or self._since_start > FIRST_FRAMES:
                self._frozen_ns = round(FROZEN_S * 1e9)
            self._still_since_ns = None
