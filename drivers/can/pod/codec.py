"""The frames of ``pod.dbc`` in Python: packing, unpacking and the check byte.

Written by hand for speed; a test holds it against cantools and the DBC on random frames.
"""

import struct
from collections.abc import Callable
from typing import Any, Final

from drivers.can.pod.messages import (
    FOLLOW_UP_ID,
    NODES,
    SYNC_ID,
    Axes,
    ConfigReply,
    ConfigRequest,
    Counters,
    FollowUp,
    Identity,
    Kind,
    PodMessage,
    Sample,
    Status,
    Sync,
    SyncReply,
)
from drivers.errors import FrameFormatError


def _crc_table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = (value << 1 ^ 0x2F if value & 0x80 else value << 1) & 0xFF  # noqa: PLW2901 - the shift register
        table.append(value)
    return bytes(table)


_CRC_TABLE: Final = _crc_table()


def crc8(data: bytes) -> int:
    """Return the CRC-8 of ``data``: polynomial 0x2F, start and final exclusive-or 0xFF."""
    crc = 0xFF
    for byte in data:
        crc = _CRC_TABLE[crc ^ byte]
    return crc ^ 0xFF


def _closed(arbitration_id: int, body: bytes) -> tuple[int, bytes]:
    """Return identifier and payload with the check byte appended."""
    return arbitration_id, body + bytes((crc8(arbitration_id.to_bytes(2, "little") + body),))


def encode(message: PodMessage) -> tuple[int, bytes]:
    """Return identifier and payload of a message.

    Raises
    ------
    ValueError, struct.error
        If a field does not fit its place.
    """
    match message:
        case Sync(seq, layout, trigger):
            return _closed(SYNC_ID, bytes((seq, layout, int(trigger))))
        case FollowUp(seq, t_sync_us):
            return _closed(FOLLOW_UP_ID, bytes((seq,)) + t_sync_us.to_bytes(6, "little"))
    if not 0 <= message.node < NODES:
        msg = f"node {message.node}: expected 0 to {NODES - 1}"
        raise ValueError(msg)
    kind, body = _BODIES[type(message)](message)
    return _closed(kind + message.node, body)


def _axes_body(m: Axes) -> tuple[Kind, bytes]:
    return m.kind, struct.pack("<hhhB", m.x, m.y, m.z, m.seq)


def _sample_body(m: Sample) -> tuple[Kind, bytes]:
    flags = (
        m.scale
        | m.has_accel << 3
        | m.has_mag << 4
        | m.synced << 5
        | m.triggered << 6
        | m.repeated << 7
    )
    return Kind.SAMPLE, bytes((m.seq, flags)) + m.t_local_us.to_bytes(3, "little")


def _sync_reply_body(m: SyncReply) -> tuple[Kind, bytes]:
    return Kind.SYNC_REPLY, struct.pack("<BIh", m.seq, m.t_local_us, m.error_us)


def _config_request_body(m: ConfigRequest) -> tuple[Kind, bytes]:
    return Kind.CONFIG_REQUEST, struct.pack("<BBI", m.token, m.key, m.value)


def _config_reply_body(m: ConfigReply) -> tuple[Kind, bytes]:
    return Kind.CONFIG_REPLY, struct.pack("<BBIB", m.token, m.key, m.value, m.result)


def _status_body(m: Status) -> tuple[Kind, bytes]:
    modes = m.mode | m.state << 4
    rest = struct.pack("<BBbB", modes, m.calibration, m.temperature_degc, m.chip_error)
    return Kind.STATUS, m.uptime_s.to_bytes(3, "little") + rest


def _counters_body(m: Counters) -> tuple[Kind, bytes]:
    return Kind.COUNTERS, bytes((m.page,)) + struct.pack(_COUNTER_FORMATS[m.page], *m.values)


def _identity_body(m: Identity) -> tuple[Kind, bytes]:
    return Kind.IDENTITY, bytes((m.part,)) + m.payload.ljust(6, b"\x00")


_BODIES: Final[dict[type, Callable[[Any], tuple[Kind, bytes]]]] = {
    Axes: _axes_body,
    Sample: _sample_body,
    SyncReply: _sync_reply_body,
    ConfigRequest: _config_request_body,
    ConfigReply: _config_reply_body,
    Status: _status_body,
    Counters: _counters_body,
    Identity: _identity_body,
}
_COUNTER_FORMATS: Final = ("<HHH", "<HHH", "<HHH", "<HHH", "<IH")
_IDENTITY_PARTS: Final = 6
_LENGTHS: Final = {
    Kind.GYRO: 8, Kind.ACCEL: 8, Kind.MAG: 8, Kind.SAMPLE: 6, Kind.SYNC_REPLY: 8,
    Kind.CONFIG_REQUEST: 7, Kind.CONFIG_REPLY: 8, Kind.STATUS: 8, Kind.COUNTERS: 8,
    Kind.IDENTITY: 8,
}  # fmt: skip
_IDS: Final = {kind + node: (kind, node) for kind in Kind for node in range(NODES)}


def is_ours(arbitration_id: int) -> bool:
    """Whether an identifier belongs to the layout."""
    return arbitration_id in _IDS or arbitration_id in (SYNC_ID, FOLLOW_UP_ID)


def filters() -> tuple[tuple[int, int], ...]:
    """Return (identifier, mask) of what a receiver has to let through."""
    return ((SYNC_ID, 0x7FE), *((int(kind), 0x7F0) for kind in Kind))


def decode(arbitration_id: int, data: bytes) -> PodMessage:
    """Return the message in a frame.

    Parameters
    ----------
    arbitration_id : int
        Standard identifier.
    data : bytes
        Payload.

    Raises
    ------
    FrameFormatError
        If identifier, length, check byte or a page number is wrong.
    """
    kind, node = _IDS.get(arbitration_id, (None, 0))
    if kind is not None:
        length = _LENGTHS[kind]
    elif arbitration_id in (SYNC_ID, FOLLOW_UP_ID):
        length = 4 if arbitration_id == SYNC_ID else 8
    else:
        msg = f"identifier 0x{arbitration_id:03X} is not in the pod layout"
        raise FrameFormatError(msg)
    if len(data) != length:
        msg = f"frame 0x{arbitration_id:03X}: {len(data)} bytes, expected {length}"
        raise FrameFormatError(msg)
    wanted = crc8(arbitration_id.to_bytes(2, "little") + data[:-1])
    if data[-1] != wanted:
        msg = f"frame 0x{arbitration_id:03X}: check byte 0x{data[-1]:02X}, expected 0x{wanted:02X}"
        raise FrameFormatError(msg)
    if kind is None:
        if arbitration_id == SYNC_ID:
            return Sync(data[0], data[1], bool(data[2] & 1))
        return FollowUp(data[0], int.from_bytes(data[1:7], "little"))
    return _DECODERS[kind](kind, node, data)


def _axes(kind: Kind, node: int, data: bytes) -> Axes:
    x, y, z, seq, _ = struct.unpack("<hhhBB", data)
    return Axes(kind, node, seq, x, y, z)


def _sample(_kind: Kind, node: int, data: bytes) -> Sample:
    flags = data[1]
    return Sample(
        node,
        data[0],
        int.from_bytes(data[2:5], "little"),
        scale=flags & 7,
        has_accel=bool(flags & 8),
        has_mag=bool(flags & 16),
        synced=bool(flags & 32),
        triggered=bool(flags & 64),
        repeated=bool(flags & 128),
    )


def _sync_reply(_kind: Kind, node: int, data: bytes) -> SyncReply:
    return SyncReply(node, *struct.unpack("<BIh", data[:7]))


def _config_request(_kind: Kind, node: int, data: bytes) -> ConfigRequest:
    return ConfigRequest(node, *struct.unpack("<BBI", data[:6]))


def _config_reply(_kind: Kind, node: int, data: bytes) -> ConfigReply:
    return ConfigReply(node, *struct.unpack("<BBIB", data[:7]))


def _status(_kind: Kind, node: int, data: bytes) -> Status:
    modes, calibration, temperature_degc, chip_error = struct.unpack("<BBbB", data[3:7])
    uptime_s = int.from_bytes(data[:3], "little")
    return Status(node, uptime_s, modes & 15, modes >> 4, calibration, temperature_degc, chip_error)


def _counters(_kind: Kind, node: int, data: bytes) -> Counters:
    if data[0] >= len(_COUNTER_FORMATS):
        msg = f"pod {node}: counter page {data[0]}, expected 0 to {len(_COUNTER_FORMATS) - 1}"
        raise FrameFormatError(msg)
    return Counters(node, data[0], struct.unpack(_COUNTER_FORMATS[data[0]], data[1:7]))


def _identity(_kind: Kind, node: int, data: bytes) -> Identity:
    if data[0] >= _IDENTITY_PARTS:
        msg = f"pod {node}: identity part {data[0]}, expected 0 to {_IDENTITY_PARTS - 1}"
        raise FrameFormatError(msg)
    return Identity(node, data[0], bytes(data[1:7]))


_DECODERS: Final[dict[Kind, Callable[[Kind, int, bytes], PodMessage]]] = {
    Kind.GYRO: _axes,
    Kind.ACCEL: _axes,
    Kind.MAG: _axes,
    Kind.SAMPLE: _sample,
    Kind.SYNC_REPLY: _sync_reply,
    Kind.CONFIG_REQUEST: _config_request,
    Kind.CONFIG_REPLY: _config_reply,
    Kind.STATUS: _status,
    Kind.COUNTERS: _counters,
    Kind.IDENTITY: _identity,
}
