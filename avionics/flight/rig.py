"""A rig: the clock, the sensors and, on a simulated wing, the truth."""

from dataclasses import dataclass, field

from avionics.records import Truth
from drivers.clock import Clock
from drivers.interfaces import Source
from drivers.samples import Frame, ImuSample


@dataclass(slots=True)
class Rig:
    """What a run flies with; closes everything it holds.

    Attributes
    ----------
    clock : Clock
        The one clock of all samples.
    imus : list of Source of ImuSample
        One source per bus; a source may serve several pods.
    cameras : list of Source of Frame
        Sources of frames.
    truth : Source of Truth or None
        The simulated wing's own shape.
    """

    clock: Clock
    imus: list[Source[ImuSample]] = field(default_factory=list)
    cameras: list[Source[Frame]] = field(default_factory=list)
    truth: Source[Truth] | None = None

    def close(self) -> None:
        """Close every source; may be called twice."""
        for source in (*self.imus, *self.cameras):
            source.close()
        if self.truth is not None:
            self.truth.close()

    def __enter__(self) -> "Rig":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
