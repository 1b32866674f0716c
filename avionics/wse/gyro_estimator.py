"""What can fly beside the camera-aided filter: an estimator from gyros, asked at the ticks."""

from typing import Literal, Protocol

from avionics.wse.gyro_rates import GyroInputs
from avionics.wse.state import Estimate

Change = tuple[Literal["info", "warning"], str]


class GyroEstimator(Protocol):
    """An estimator of its own kind, fed with the samples that every estimator gets.

    A pure function of its calls: no clock, no thread, no randomness.
    """

    @property
    def inputs(self) -> GyroInputs:
        """Where the samples of the pods and of the root go."""
        ...

    def restart(self) -> None:
        """Forget the past: the next samples are a new start."""
        ...

    def advance(self, now_ns: int) -> list[Change]:
        """Run over every step that is known at ``now_ns``; return what there is to report."""
        ...

    def estimate_at(self, tick_ns: int) -> Estimate | None:
        """Return the estimate for a tick, in the layout of the camera-aided filter, or None."""
        ...
