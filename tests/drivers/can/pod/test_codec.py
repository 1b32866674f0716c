"""The Python codec against cantools and the one DBC."""

import random

import cantools.database
import pytest

from drivers.can.pod import codec
from drivers.can.pod.codec import crc8, decode, encode
from drivers.can.pod.messages import (
    COUNTER_NAMES,
    NODES,
    Axes,
    ConfigReply,
    ConfigRequest,
    Counters,
    FollowUp,
    Identity,
    Kind,
    Sample,
    Status,
    Sync,
    SyncReply,
)
from drivers.can.pod.replicate import dbc_text, node_zero_text, replicate
from drivers.errors import FrameFormatError

DATABASE = cantools.database.load_string(dbc_text(), "dbc", strict=True)
AXES = {Kind.GYRO: 1.0, Kind.ACCEL: 0.01, Kind.MAG: 0.0625}


def random_message(rng: random.Random):
    u8, node = rng.randrange(256), rng.randrange(NODES)
    word = lambda: rng.randrange(-32768, 32768)  # noqa: E731 - three in a row
    flag = lambda: rng.random() < 0.5  # noqa: E731
    u16, u32 = rng.randrange(1 << 16), rng.randrange(1 << 32)
    page = rng.randrange(5)
    values = (u32, u16) if page == 4 else tuple(rng.randrange(1 << 16) for _ in range(3))
    return rng.choice(
        [
            Sync(u8, rng.randrange(256), flag()),
            FollowUp(u8, rng.randrange(1 << 48)),
            Axes(rng.choice(list(AXES)), node, u8, word(), word(), word()),
            Sample(
                node, u8, rng.randrange(1 << 24), rng.randrange(6),
                flag(), flag(), flag(), flag(), flag(),
            ),
            SyncReply(node, u8, u32, word()),
            ConfigRequest(node, u8, rng.randrange(256), u32),
            ConfigReply(node, u8, rng.randrange(256), u32, rng.randrange(6)),
            Status(
                node, rng.randrange(1 << 24), rng.randrange(16), rng.randrange(5), u8,
                rng.randrange(-128, 128), rng.randrange(256),
            ),
            Counters(node, page, values),
        ]
    )  # fmt: skip


def named(message) -> dict[str, float]:
    """The signals that the DBC should show for a message."""
    fields = {k: getattr(message, k) for k in message.__slots__ if k not in ("node", "kind")}
    if isinstance(message, Axes):
        factor = AXES[message.kind]
        fields |= {axis: getattr(message, axis) * factor for axis in "xyz"}
    if isinstance(message, Counters):
        return {
            "page": message.page,
            **dict(zip(COUNTER_NAMES[message.page], message.values, strict=True)),
        }
    if isinstance(message, Status):
        calibration = fields.pop("calibration")
        for i, part in enumerate(("mag", "accel", "gyro", "system")):
            fields[f"calib_{part}"] = calibration >> 2 * i & 3
    return {name: int(v) if isinstance(v, bool) else v for name, v in fields.items()}


def test_codec_agrees_with_cantools_on_random_frames() -> None:
    rng = random.Random(4)
    for _ in range(3000):
        message = random_message(rng)
        arbitration_id, data = encode(message)
        signals = DATABASE.decode_message(arbitration_id, data, decode_choices=False)
        crc = signals.pop("crc")
        assert signals == pytest.approx(named(message), abs=1e-9)
        assert crc == data[-1]
        again = DATABASE.encode_message(arbitration_id, {**signals, "crc": crc}, strict=True)
        assert bytes(again) == data
        assert decode(arbitration_id, data) == message


@pytest.mark.parametrize("part", range(6))
def test_identity_parts_lie_where_the_dbc_says(part: int) -> None:
    payload = bytes(range(0x31, 0x31 + (4 if part == 5 else 6)))
    arbitration_id, data = encode(Identity(7, part, payload))
    signals = DATABASE.decode_message(arbitration_id, data, decode_choices=False)
    assert decode(arbitration_id, data) == Identity(7, part, payload.ljust(6, b"\0"))
    if part == 0:
        names = ("layout", "fw_major", "fw_minor", "fw_patch", "reset_cause", "refusal")
        assert [signals[n] for n in names] == list(payload)
    else:
        (uid,) = (v for k, v in signals.items() if "uid" in k)
        assert uid.to_bytes(len(payload), "little") == payload


def test_crc_has_the_published_check_value() -> None:
    assert crc8(b"123456789") == 0xDF  # AUTOSAR CRC8H2F


def test_layout_keeps_the_identifiers_low_and_the_order_of_urgency() -> None:
    ids = {m.name: m.frame_id for m in DATABASE.messages}
    assert max(ids.values()) <= 0x3FF
    assert len(ids) == 2 + NODES * len(Kind)
    order = ["Sync", "FollowUp"] + [
        f"Pod{{:02d}}_{kind}" for kind in ("Gyro", "Accel", "Mag", "Sample", "SyncReply")
    ]
    flat = [ids[name.format(n)] for name in order for n in (0, 15)]
    assert flat == sorted(flat)
    assert all(m.length <= 8 and not m.is_extended_frame for m in DATABASE.messages)


def test_every_pod_has_the_layout_of_pod_0() -> None:
    assert replicate(dbc_text()) == dbc_text()
    zero = cantools.database.load_string(node_zero_text(dbc_text()), "dbc")
    assert [m.name for m in zero.messages][:3] == ["Sync", "FollowUp", "Gyro"]
    assert len(zero.messages) == 2 + len(Kind)


def test_truncated_and_foreign_frames_are_refused() -> None:
    arbitration_id, data = encode(Axes(Kind.GYRO, 3, 9, 1, -2, 3))
    for length in range(8):
        with pytest.raises(FrameFormatError, match=r"frame 0x103: . bytes, expected 8"):
            decode(arbitration_id, data[:length])
    with pytest.raises(FrameFormatError, match="not in the pod layout"):
        decode(0x7FF, data)
    assert not codec.is_ours(0x7FF)
    assert codec.is_ours(arbitration_id)


def test_check_byte_sees_any_flip_a_foreign_pod_and_a_stale_tail() -> None:
    arbitration_id, data = encode(Axes(Kind.GYRO, 3, 9, 1, -2, 3))
    for bit in range(64):
        broken = bytearray(data)
        broken[bit // 8] ^= 1 << bit % 8
        with pytest.raises(FrameFormatError, match="check byte"):
            decode(arbitration_id, bytes(broken))
    with pytest.raises(FrameFormatError, match="check byte"):
        decode(arbitration_id + 1, data)
    # What slcan makes of a truncated line: the tail of the line before (spec, hardware rig, 3).
    _, before = encode(Axes(Kind.GYRO, 3, 8, 700, -900, 40))
    for cut in range(1, 7):
        with pytest.raises(FrameFormatError, match="check byte"):
            decode(arbitration_id, data[:cut] + before[cut:])


@pytest.mark.parametrize("kind", [Kind.COUNTERS, Kind.IDENTITY])
def test_unknown_page_is_refused(kind: Kind) -> None:
    body = bytes((200, 0, 0, 0, 0, 0, 0))
    data = body + bytes((crc8((kind + 1).to_bytes(2, "little") + body),))
    with pytest.raises(FrameFormatError, match="pod 1"):
        decode(kind + 1, data)


def test_node_out_of_range_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="node 16"):
        encode(SyncReply(16, 0, 0))
