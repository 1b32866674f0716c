"""From record to protobuf bytes; ``decode`` is the way back."""

import struct
from collections.abc import Callable
from functools import lru_cache
from operator import attrgetter
from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message

from avionics.recording.schema.messages import MESSAGE_OF, camera_frame, to_timestamp
from avionics.recording.schema.packed import PackedFields
from avionics.recording.schema.plain import PlainRecord
from avionics.recording.schema.proto import records_pb2
from avionics.records import EncodedFrame, Event, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import ImuSample

LEVELS = {"info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR}

_ESTIMATE_FIELDS = PackedFields(
    records_pb2.WingShapeEstimate,
    "phi_rad",
    "theta_rad",
    "psi_rad",
    "phi_sigma_rad",
    "theta_sigma_rad",
    "psi_sigma_rad",
    "bias_rad_s",
    "bias_sigma_rad_s",
    "line_in_body_m",
    "tip_sigma_m",
    "marker_px",
    "marker_sigma_px",
)
_ESTIMATE_LAST_FIELDS = PackedFields(records_pb2.WingShapeEstimate, "used", "covariance")
_TRUTH_FIELDS = PackedFields(
    records_pb2.Truth,
    "marker_in_body_m",
    "line_in_body_m",
    "phi_rad",
    "theta_rad",
    "psi_rad",
)
_TIME = struct.Struct("<Bq")
_TIME_TAG = 1 << 3 | 1
_DOUBLE = struct.Struct("<2sd")
_NIS_TAG = b"\x89\x01"
"""Field 17, eight bytes."""
_NIS_ZERO = _DOUBLE.pack(_NIS_TAG, 0.0)


def _packed(message: Message) -> bytes:
    return message.SerializeToString(deterministic=True)


def _image(record: EncodedFrame, utc_offset_ns: int) -> bytes:
    message = CompressedImage(
        timestamp=to_timestamp(record.t_ns + utc_offset_ns),
        frame_id=camera_frame(record.camera),
        data=record.data,
        format=record.format,
    )
    return _packed(message)


def _tracks(record: MarkerTracks, _: int) -> bytes:
    message = records_pb2.MarkerTracks(
        t_ns=record.t_ns,
        camera=record.camera,
        frame_index=record.frame_index,
        pixel=record.pixel.ravel().tolist(),
        sigma_px=record.sigma_px.tolist(),
        found=record.found.tolist(),
        tracker=record.tracker,
    )
    return _packed(message)


def _estimate(record: WingShapeEstimate, _: int) -> bytes:
    nis = _DOUBLE.pack(_NIS_TAG, record.nis)
    parts = (
        _time(record.t_ns),
        _estimate_names(record.wing, record.kind, record.basis),
        _ESTIMATE_FIELDS.of(record),
        # As everywhere in protobuf 3, zero is what is not there; minus zero is.
        b"" if nis == _NIS_ZERO else nis,
        _ESTIMATE_LAST_FIELDS.of(record),
    )
    return b"".join(parts)


def _truth(record: Truth, _: int) -> bytes:
    names = _truth_names(record.wing, record.source)
    return _time(record.t_ns) + names + _TRUTH_FIELDS.of(record)


def _time(t_ns: int) -> bytes:
    """Return ``t_ns`` as every record of ours begins: field 1, sfixed64."""
    return _TIME.pack(_TIME_TAG, t_ns) if t_ns else b""


@lru_cache(maxsize=16)
def _estimate_names(wing: str, kind: str, basis: str) -> bytes:
    return _packed(records_pb2.WingShapeEstimate(wing=wing, kind=kind, basis=basis))


@lru_cache(maxsize=16)
def _truth_names(wing: str, source: str) -> bytes:
    return _packed(records_pb2.Truth(wing=wing, source=source))


def _health(record: Health, _: int) -> bytes:
    message = records_pb2.Health(t_ns=record.t_ns, source=record.source, counters=record.counters)
    return _packed(message)


def _event(record: Event, utc_offset_ns: int) -> bytes:
    message = Log(
        timestamp=to_timestamp(record.t_ns + utc_offset_ns),
        level=LEVELS[record.level],
        message=record.message,
        name=record.source,
    )
    return _packed(message)


_OWN_ENCODERS: dict[type, Callable[[Any, int], bytes]] = {
    EncodedFrame: _image,
    MarkerTracks: _tracks,
    WingShapeEstimate: _estimate,
    Truth: _truth,
    Health: _health,
    Event: _event,
}
_ENCODERS: dict[type, Callable[[Any, int], bytes]] = {
    record: _OWN_ENCODERS.get(record) or PlainRecord(record, message).encode
    for record, message in MESSAGE_OF.items()
}


_NUMBERS: dict[type, Callable[[Any], int]] = {
    ImuSample: attrgetter("seq"),
    EncodedFrame: attrgetter("index"),
    MarkerTracks: attrgetter("frame_index"),
}


def encode(record: Any, utc_offset_ns: int) -> bytes:
    """Return the protobuf bytes of a record; the same record always gives the same bytes.

    Parameters
    ----------
    record : Record
        What to encode; any type of ``MESSAGE_OF``.
    utc_offset_ns : int
        UTC minus steady time, ns; needed where the schema is Foxglove's.
    """
    return _ENCODERS[type(record)](record, utc_offset_ns)


def sequence_of(record: Any) -> int:
    """Return the MCAP sequence number: the source's own count where it has one, else 0.

    The frame index of an image lives here, since Foxglove's schema has no place for it.
    """
    number = _NUMBERS.get(type(record))
    return 0 if number is None else number(record) & 0xFFFFFFFF
