"""From protobuf bytes back to the record, bit for bit."""

from collections.abc import Callable
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from avionics.recording.schema.encode import LEVELS
from avionics.recording.schema.messages import (
    CAMERA_FRAME,
    MESSAGE_OF,
    from_timestamp,
    schema_name,
)
from avionics.recording.schema.plain import PlainRecord
from avionics.recording.schema.proto import records_pb2
from avionics.records import (
    EncodedFrame,
    Event,
    FloatArray,
    Health,
    MarkerTracks,
    Truth,
    WingShapeEstimate,
)
from avionics.topics import Record

_TIME_TAG = b"\x0a"
"""Field 1, length-delimited."""
_LEVEL_NAMES = {number: name for name, number in LEVELS.items()}


_DOUBLE = np.dtype(np.float64)
_FLAG = np.dtype(np.bool_)


def _vector(values: Any) -> FloatArray:
    return np.fromiter(values, _DOUBLE, len(values))


def _optional(values: Any) -> FloatArray | None:
    return np.fromiter(values, _DOUBLE, len(values)) if values else None


def _rows(values: Any, width: int) -> FloatArray:
    return np.fromiter(values, _DOUBLE, len(values)).reshape(-1, width)


def _flags(values: Any) -> NDArray[np.bool_]:
    return np.fromiter(values, _FLAG, len(values))


def _image(data: bytes, sequence: int, utc_offset_ns: int) -> EncodedFrame:
    message = CompressedImage.FromString(data)
    t_ns = from_timestamp(message.timestamp) - utc_offset_ns
    camera = message.frame_id.removeprefix(CAMERA_FRAME)
    return EncodedFrame(t_ns, camera, sequence, message.format, message.data)


def exposure_ns(data: bytes, utc_offset_ns: int) -> int:
    """Return when a compressed image was exposed, without copying the picture.

    Raises
    ------
    DecodeError
        If the bytes are no image.
    """
    # Fields stand in the order of their numbers; the time is the first, and short.
    if data[:1] == _TIME_TAG and len(data) > 1 and data[1] < 0x80:
        timestamp = Timestamp.FromString(data[2 : 2 + data[1]])
    else:
        timestamp = CompressedImage.FromString(data).timestamp
    return from_timestamp(timestamp) - utc_offset_ns


def _tracks(data: bytes, _: int, __: int) -> MarkerTracks:
    message = records_pb2.MarkerTracks.FromString(data)
    return MarkerTracks(
        message.t_ns,
        message.camera,
        message.frame_index,
        _rows(message.pixel, 2),
        _vector(message.sigma_px),
        _flags(message.found),
        message.tracker,
    )


def _estimate(data: bytes, _: int, __: int) -> WingShapeEstimate:
    message = records_pb2.WingShapeEstimate.FromString(data)
    size = round(len(message.covariance) ** 0.5)
    return WingShapeEstimate(
        t_ns=message.t_ns,
        wing=message.wing,
        kind=message.kind,  # type: ignore[arg-type]  # written from the same literal
        basis=message.basis,
        phi_rad=_vector(message.phi_rad),
        theta_rad=_vector(message.theta_rad),
        psi_rad=_vector(message.psi_rad),
        phi_sigma_rad=_vector(message.phi_sigma_rad),
        theta_sigma_rad=_vector(message.theta_sigma_rad),
        psi_sigma_rad=_vector(message.psi_sigma_rad),
        bias_rad_s=_rows(message.bias_rad_s, 3),
        bias_sigma_rad_s=_rows(message.bias_sigma_rad_s, 3),
        line_in_body_m=_rows(message.line_in_body_m, 3),
        tip_sigma_m=_vector(message.tip_sigma_m),
        marker_px=_rows(message.marker_px, 2),
        marker_sigma_px=_rows(message.marker_sigma_px, 2),
        nis=message.nis,
        used=_flags(message.used),
        covariance=_rows(message.covariance, size) if size else None,
    )


def _truth(data: bytes, _: int, __: int) -> Truth:
    message = records_pb2.Truth.FromString(data)
    line = message.line_in_body_m
    return Truth(
        message.t_ns,
        message.wing,
        message.source,  # type: ignore[arg-type]  # written from the same literal
        _rows(message.marker_in_body_m, 3),
        _rows(line, 3) if line else None,
        _optional(message.phi_rad),
        _optional(message.theta_rad),
        _optional(message.psi_rad),
    )


def _health(data: bytes, _: int, __: int) -> Health:
    message = records_pb2.Health.FromString(data)
    counters = dict(sorted(message.counters.items()))
    return Health(message.t_ns, message.source, counters)


def _event(data: bytes, _: int, utc_offset_ns: int) -> Event:
    message = Log.FromString(data)
    t_ns = from_timestamp(message.timestamp) - utc_offset_ns
    level: Any = _LEVEL_NAMES.get(message.level, "error")
    return Event(t_ns, message.name, level, message.message)


_OWN_DECODERS: dict[type, Callable[[bytes, int, int], Record]] = {
    EncodedFrame: _image,
    MarkerTracks: _tracks,
    WingShapeEstimate: _estimate,
    Truth: _truth,
    Health: _health,
    Event: _event,
}

DECODER_OF: dict[str, Callable[[bytes, int, int], Record]] = {
    schema_name(message): _OWN_DECODERS.get(record) or PlainRecord(record, message).decode
    for record, message in MESSAGE_OF.items()
}
"""By schema name; each takes the message's bytes, its MCAP sequence and ``utc_offset_ns``."""
