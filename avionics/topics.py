"""Names of the log's topics, and the sink that every record goes to."""

from typing import Protocol

from avionics.records import (
    EncodedFrame,
    Event,
    Health,
    MarkerTracks,
    Truth,
    WingShapeEstimate,
)
from drivers.samples import Frame, ImuSample

Record = (
    ImuSample | Frame | EncodedFrame | MarkerTracks | WingShapeEstimate | Health | Event | Truth
)

HEALTH = "/health"
EVENT = "/event"


class Sink(Protocol):
    """Takes records in pipeline order: the recorder, the live server, a list in memory.

    Topic (``topic_of``) and time (``record.t_ns``) follow from the record.
    """

    def write(self, record: Record, arrival_ns: int) -> None:
        """Take one record that arrived at ``arrival_ns``."""
        ...


def topic_of(record: Record) -> str:
    """Return the topic that a record belongs to."""
    match record:
        case ImuSample():
            topic = f"/imu/{record.pod}"
        case Frame() | EncodedFrame():
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
