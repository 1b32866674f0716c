"""Data that stand still: passed on at first, refused when stale, called frozen in the end."""

from collections import Counter
from typing import Final

import numpy as np

from drivers.burst import Words, is_all_zero

# The chip makes data as often as it is read; noise alone moves some bit of the next burst.
STALE_AFTER: Final = 5
FROZEN_AFTER: Final = 25
REPEATS_BEFORE_CHECK: Final = 3


class Repeats:
    """Counts bursts that repeat the one before, and reports the fault that follows from it.

    Parameters
    ----------
    has_accel : bool
        A gyro alone may show all zeros at rest; with an accelerometer a chip cannot.
    counters : Counter of str
        Where repeats are counted.

    Attributes
    ----------
    is_doubtful : bool
        Whether the data call for a look at the chip's state.
    """

    def __init__(self, *, has_accel: bool, counters: Counter[str]) -> None:
        self._has_accel = has_accel
        self._counters = counters
        self._frozen_after = FROZEN_AFTER
        self.forget()

    def forget(self) -> None:
        """Start over: the chip was configured again."""
        self._count = 0
        self.is_doubtful = self._is_verified = False

    def verified(self) -> None:
        """Note that the chip's state is as it has to be: it may show zeros at rest."""
        self._is_verified = True

    @property
    def is_frozen(self) -> bool:
        """Whether the data have not moved for so long that only a reset may help."""
        return self._count >= self._frozen_after

    def wait_longer(self) -> None:
        """Wait twice as long before data are called frozen again: a reset may not help."""
        self._frozen_after *= 2

    def pass_on(self, values: Words, previous: Words | None) -> bool:
        """Return whether a burst may be used; counts those that repeat the ``previous`` one.

        All-zero data are refused at once, unless a gyro alone may show them at rest.
        """
        is_zero = is_all_zero(values)
        if not is_zero and (previous is None or not np.array_equal(values, previous)):
            self.forget()
            self._frozen_after = FROZEN_AFTER
            return True
        self._count += 1
        self.is_doubtful |= is_zero and not self._is_verified
        self.is_doubtful |= self._count % FROZEN_AFTER == REPEATS_BEFORE_CHECK
        if is_zero and (self._has_accel or not self._is_verified):
            self._counters["all_zero"] += 1
            return False
        self._counters["repeated"] += 1
        if self._count >= STALE_AFTER:
            self._counters["stale"] += 1
            return False
        return True
