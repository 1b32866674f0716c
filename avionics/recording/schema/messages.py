"""Which protobuf message each record becomes, and the schema bytes that the log carries for it."""

from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from avionics.recording.schema.proto import records_pb2
from avionics.records import EncodedFrame, Event, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import ImuSample

CAMERA_FRAME = "camera/"
NANOSECONDS = 1_000_000_000

MESSAGE_OF: dict[type, type[Message]] = {
    ImuSample: records_pb2.ImuSample,
    EncodedFrame: CompressedImage,
    MarkerTracks: records_pb2.MarkerTracks,
    WingShapeEstimate: records_pb2.WingShapeEstimate,
    Truth: records_pb2.Truth,
    Health: records_pb2.Health,
    Event: Log,
}


def schema_name(message: type[Message]) -> str:
    """Return the full protobuf name, e.g. ``avionics.ImuSample``."""
    return str(message.DESCRIPTOR.full_name)


def schema_bytes(message: type[Message]) -> bytes:
    """Return the serialised FileDescriptorSet of a message and all that it refers to."""
    files: dict[str, Any] = {}

    def visit(file: Any) -> None:
        if file.name in files:
            return
        for dependency in file.dependencies:
            visit(dependency)
        files[file.name] = file

    visit(message.DESCRIPTOR.file)
    descriptors = FileDescriptorSet()
    for file in files.values():
        file.CopyToProto(descriptors.file.add())
    return descriptors.SerializeToString(deterministic=True)


def camera_frame(camera: str) -> str:
    """Return Foxglove's name of a camera's frame of reference."""
    return f"{CAMERA_FRAME}{camera}"


def to_timestamp(utc_ns: int) -> Timestamp:
    """Return a protobuf time from UTC ns; exact, also before 1970."""
    seconds, nanos = divmod(utc_ns, NANOSECONDS)
    return Timestamp(seconds=seconds, nanos=nanos)


def from_timestamp(timestamp: Timestamp) -> int:
    """Return UTC ns from a protobuf time; exact."""
    return timestamp.seconds * NANOSECONDS + timestamp.nanos
