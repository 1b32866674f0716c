"""What is packed by hand is what the generated classes make, byte for byte."""

from typing import Any

import numpy as np
import pytest
from google.protobuf.message import Message

from avionics.recording.schema.encode import encode, sequence_of
from avionics.recording.schema.packed import PackedFields, varint
from avionics.recording.schema.proto import records_pb2
from avionics.records import MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import ImuSample
from tests.avionics.recording.conftest import make_records

CLASSES: dict[type, type[Message]] = {
    ImuSample: records_pb2.ImuSample,
    MarkerTracks: records_pb2.MarkerTracks,
    WingShapeEstimate: records_pb2.WingShapeEstimate,
    Truth: records_pb2.Truth,
}


def generated(record: Any) -> bytes:
    """Fill the generated class field by field."""
    message = CLASSES[type(record)]()
    for name in message.DESCRIPTOR.fields_by_name:
        value = getattr(record, name)
        if isinstance(value, np.ndarray):
            getattr(message, name).extend(value.ravel().tolist())
        elif value is not None:
            setattr(message, name, value)
    return message.SerializeToString(deterministic=True)


@pytest.mark.parametrize("seed", range(20))
def test_records_of_ours_are_the_generated_messages(seed: int) -> None:
    for record in make_records(np.random.default_rng(seed)):
        if type(record) in CLASSES:
            assert encode(record, 5) == generated(record)


def estimate(**changes: Any) -> WingShapeEstimate:
    none, pods, pixels = np.empty(0), np.empty((0, 3)), np.empty((0, 2))
    fields = {
        "t_ns": 1, "wing": "w", "kind": "rg", "basis": "b", "phi_rad": none, "theta_rad": none,
        "psi_rad": none, "phi_sigma_rad": none, "theta_sigma_rad": none, "psi_sigma_rad": none,
        "bias_rad_s": pods, "bias_sigma_rad_s": pods, "line_in_body_m": pods, "tip_sigma_m": none,
        "marker_px": pixels, "marker_sigma_px": pixels, "nis": 0.0, "used": np.empty(0, bool),
    }  # fmt: skip
    return WingShapeEstimate(**{**fields, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("nis", [0.0, -0.0, 1.5, float("nan"), float("inf"), 5e-324])
@pytest.mark.parametrize("t_ns", [0, 1, -1, 1 << 62])
def test_zero_is_left_out_as_protobuf_does(nis: float, t_ns: int) -> None:
    record = estimate(nis=nis, t_ns=t_ns)
    assert encode(record, 0) == generated(record)


def test_an_array_may_be_a_view_or_of_another_type() -> None:
    grid = np.arange(24.0).reshape(4, 6)
    swapped = grid[:, :3].astype(">f8")
    for array in (grid[:, ::2], grid.T[:3].T, grid[:, :3].astype(np.float32), swapped, swapped.T):
        record = estimate(line_in_body_m=array)
        assert encode(record, 0) == generated(record)
    record = estimate(phi_rad=np.arange(3), used=np.array([1, 0]))
    assert encode(record, 0) == generated(
        estimate(phi_rad=np.arange(3.0), used=np.array([True, False]))
    )


def test_long_arrays_have_long_lengths() -> None:
    for size in (15, 16, 17, 2048, 300_000):
        record = estimate(covariance=np.arange(float(size)))
        assert encode(record, 0) == generated(record)


def test_names_of_one_wing_do_not_stick_to_another() -> None:
    for wing in ("left", "right", "left"):
        for kind in ("rg", "crg"):
            record = estimate(wing=wing, kind=kind)
            assert encode(record, 0) == generated(record)


def test_varint() -> None:
    assert [varint(n) for n in (0, 1, 127, 128, 300)] == [
        b"\x00", b"\x01", b"\x7f", b"\x80\x01", b"\xac\x02",
    ]  # fmt: skip


def test_only_packed_fields_can_be_packed() -> None:
    with pytest.raises(KeyError):
        PackedFields(records_pb2.WingShapeEstimate, "phi_rad", "wing")


def test_sequence_is_the_sources_own_count() -> None:
    numbers = {
        type(record).__name__: sequence_of(record)
        for record in make_records(np.random.default_rng(0))
    }
    assert numbers["ImuSample"] == 2**40 & 0xFFFFFFFF
    assert numbers["MarkerTracks"] == 41
    assert numbers["Health"] == numbers["Event"] == numbers["WingShapeEstimate"] == 0
