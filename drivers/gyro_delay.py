"""How old a rate is when it is read: what a chip's filter and its registers make of it."""

import math
from dataclasses import dataclass


def low_pass_delay_s(bandwidth_hz: float) -> float:
    """Return the delay of a second-order (Butterworth) low-pass at low frequency, s."""
    return math.sqrt(2.0) / (2.0 * math.pi * bandwidth_hz)


@dataclass(frozen=True, slots=True)
class GyroDelay:
    """Age of the rates of one chip in one state.

    Attributes
    ----------
    filter_s : float
        Group delay of the chip's low-pass at low frequency, s.
    hold_s : float
        How long a register holds its value until the next one comes, s. The reads stand at no
        fixed phase to it, so a value is between 0 and ``hold_s`` older than the filter makes it.
    """

    filter_s: float
    hold_s: float

    @property
    def mean_s(self) -> float:
        """Mean age of a rate, s."""
        return self.filter_s + self.spread_s

    @property
    def spread_s(self) -> float:
        """Half of the interval, s, over which the age is spread evenly about its mean."""
        return 0.5 * self.hold_s
