"""Names of the log's topics, and the sink that every record goes to."""

from typing import Protocol

from avionics.records import Event, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import Frame, ImuSample

Record = ImuSample | Frame | MarkerTracks | WingShapeEstimate | Health | Event | Truth

HEALTH = "/health"
EVENT = "/event"


class Sink(Protocol):
    """Takes records in pipeline order: the recorder, the live server, a list in memory."""

    def write(self, topic: str, record: Record, t_ns: int, arrival_ns: int) -> None:
        """Take one record that was true at ``t_ns`` and arrived at ``arrival_ns``."""
        ...


def topic_of(record: Record) -> str:
    """Return the topic that a record belongs to."""
    match record:
        case ImuSample():
            topic = f"/imu/{record.pod}"
        case Frame():
            topic = f"/camera/{record.camera}/image"
        case MarkerTracks():
            topic = f"/camera/{record.camera}/tracks"
        case WingShapeEstimate():
            topic = f"/wing/{record.wing}/estimate_{record.kind}"
        case Truth():
            topic = f"/wing/{record.wing}/truth"
        case Health():
            topic = HEALTH
        case Event():
            topic = EVENT
    return topic
