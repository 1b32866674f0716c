"""The words of a burst of registers, and what the bursts before let expect of the next one."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int32]

LONGEST_LEAD_NS: Final = 30_000_000


def is_all_zero(values: Words) -> bool:
    """Whether every word is zero: what a chip that has lost its mode, or a dead line, serves."""
    return not values.any()


def agree(values: Words, other: Words, step_limit: Words) -> bool:
    """Whether two bursts show the same motion: no word apart by more than its limit."""
    return bool((np.abs(values - other) <= step_limit).all())


class BurstLine:
    """The last good burst, and where the line through the last two leads."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start over: the chip was configured again."""
        self.last: Words | None = None
        self._slope: NDArray[np.float64] | None = None
        self._last_ns = 0

    def expected(self, t_ns: int) -> Words | None:
        """Return what a burst at ``t_ns`` should show; None if there was none before."""
        if self.last is None or self._slope is None:
            return self.last
        elapsed_ns = t_ns - self._last_ns
        if elapsed_ns > LONGEST_LEAD_NS:
            return self.last
        return np.asarray(self.last + self._slope * elapsed_ns, dtype=np.int32)

    def remember(self, t_ns: int, values: Words) -> None:
        """Take a good burst as the last one."""
        elapsed_ns = t_ns - self._last_ns
        self._slope = None
        if self.last is not None and 0 < elapsed_ns <= LONGEST_LEAD_NS:
            self._slope = (values - self.last) / elapsed_ns
        self.last, self._last_ns = values, t_ns
