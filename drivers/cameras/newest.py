"""``NewestFrame``: of the frames that wait in a pipe only the newest is passed on."""

from collections.abc import Callable
from typing import Final

from drivers.cameras.watch import FrameWatch
from drivers.clock import Clock
from drivers.samples import Frame

CATCH_UP_BYTES: Final = 2 << 20
"""More than a pipe or a socket holds; a writer that is faster than the reader is not followed."""
WRITER_NS: Final = 5_000_000
"""What a writer gets that a full pipe has blocked, to bring the frame behind the late one."""


class NewestFrame:
    """The place of one frame; what a newer one replaces counts as overtaken and dropped.

    Parameters
    ----------
    watch : FrameWatch
        Whose counters are used.
    clock : Clock
        The steady clock.
    """

    def __init__(self, watch: FrameWatch, clock: Clock) -> None:
        self._counters, self._clock = watch.counters, clock
        self._period_ns = watch.period_ns
        self._frame: Frame | None = None
        self._left_ns = clock.now_ns()

    @property
    def is_there(self) -> bool:
        """Whether a frame waits to be taken."""
        return self._frame is not None

    def put(self, frame: Frame) -> None:
        """Let a frame take the place."""
        if self._frame is not None:
            self._counters["overtaken"] += 1
            self._counters["dropped"] += 1
        self._frame = frame

    def take(self) -> Frame | None:
        """Return the frame that waits, if there is one."""
        frame, self._frame = self._frame, None
        self._left_ns = self._clock.now_ns()
        return frame

    def catch_up(self, receive: Callable[[int], int], is_midway: Callable[[], bool]) -> None:
        """Take everything that has come.

        Parameters
        ----------
        receive : callable
            Waits so many ns for data, puts the frames that they complete, and returns the number
            of bytes.
        is_midway : callable
            Whether a part of a frame is there.
        """
        budget, overtaken = CATCH_UP_BYTES, self._counters["overtaken"]
        while budget > 0 or is_midway():
            is_behind = self._frame is not None and (
                self._counters["overtaken"] > overtaken or is_midway() or self._is_late()
            )
            count = receive(WRITER_NS if is_behind else 0)
            if count == 0:
                return
            budget -= count

    def _is_late(self) -> bool:
        """Whether the frame is from the beginning of a long absence of the reader."""
        if self._frame is None:
            return False
        away_ns = self._clock.now_ns() - self._left_ns
        return away_ns > 2 * self._period_ns and self._frame.t_ns < self._left_ns + away_ns // 2
