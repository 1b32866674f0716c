from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from avionics.config import Config
from avionics.errors import OutputExistsError, RecordingError
from avionics.recording import EncodedFrame, LogReader, LogWriter
from avionics.topics import Record, topic_of
from drivers.samples import Frame

UTC_OFFSET_NS = 1_700_000_000_123_456_789


def png(config: Config) -> Config:
    recorder = config.recorder.model_copy(update={"image_format": "png"})
    return config.model_copy(update={"recorder": recorder})


def write_all(path: Path, config: Config, records: list[Record], **options: Any) -> None:
    with LogWriter(path, config, utc_offset_ns=UTC_OFFSET_NS, **options) as writer:
        for number, record in enumerate(records):
            arrival_ns = 1_234_567_900_000 + number * 10_000_000
            writer.write(record, arrival_ns)


def assert_same(found: Any, expected: Any) -> None:
    assert type(found) is type(expected)
    for field in fields(expected):
        a, b = getattr(found, field.name), getattr(expected, field.name)
        if isinstance(b, np.ndarray):
            assert a.dtype == b.dtype, field.name
            assert a.shape == b.shape, field.name
            assert a.tobytes() == b.tobytes(), field.name
        elif isinstance(b, float):
            np.testing.assert_array_equal(a, b)
        else:
            assert a == b, field.name
            assert type(a) is type(b), field.name


def test_every_record_comes_back_bit_for_bit(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    write_all(log_path, png(config), one_of_each)
    found = list(LogReader(log_path).messages())
    assert [item.topic for item in found] == [topic_of(record) for record in one_of_each]
    for number, (item, record) in enumerate(zip(found, one_of_each, strict=True)):
        assert item.arrival_ns == 1_234_567_900_000 + number * 10_000_000
        assert_same(item.record, record)


def test_same_records_give_same_bytes(
    tmp_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    for name in ("a.mcap", "b.mcap"):
        write_all(tmp_path / name, config, one_of_each, metadata={"command": "test"})
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_copying_a_log_copies_its_images_unchanged(
    tmp_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    write_all(tmp_path / "a.mcap", config, one_of_each)
    with LogWriter(tmp_path / "b.mcap", config, utc_offset_ns=UTC_OFFSET_NS) as writer:
        for _, record, arrival_ns in LogReader(tmp_path / "a.mcap").messages(decode_images=False):
            writer.write(record, arrival_ns)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_images_stay_encoded_when_asked(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    write_all(log_path, png(config), one_of_each)
    reader = LogReader(log_path)
    (item,) = reader.messages(["/camera/*/image"], decode_images=False)
    assert isinstance(item.record, EncodedFrame)
    (frame,) = (record for record in one_of_each if isinstance(record, Frame))
    assert_same(item.record.decode(), frame)


def test_colour_images_come_back(log_path: Path, config: Config) -> None:
    image = np.random.default_rng(1).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    write_all(log_path, png(config), [Frame(5, "root", 1, image)])
    (item,) = LogReader(log_path).messages()
    assert_same(item.record, Frame(5, "root", 1, image))


def test_two_iterations_do_not_disturb_each_other(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    write_all(log_path, config, one_of_each)
    with LogReader(log_path) as reader:
        pairs = list(zip(reader.messages(), reader.messages(), strict=True))
    assert len(pairs) == len(one_of_each)
    assert all(a.topic == b.topic and a.arrival_ns == b.arrival_ns for a, b in pairs)


def test_topics_select(log_path: Path, config: Config, one_of_each: list[Record]) -> None:
    write_all(log_path, config, one_of_each)
    topics = {item.topic for item in LogReader(log_path).messages(["/imu/*", "/event"])}
    assert topics == {"/imu/0", "/imu/root", "/event"}


def test_a_log_explains_itself(log_path: Path, config: Config, one_of_each: list[Record]) -> None:
    write_all(
        log_path,
        config,
        one_of_each,
        metadata={"command": "import", "utc_offset_ns": "cannot be replaced"},
        attachments={"calibration.json": b'{"rms_px": 0.05}'},
    )
    reader = LogReader(log_path)
    assert reader.config == config
    assert reader.utc_offset_ns == UTC_OFFSET_NS
    assert reader.metadata["command"] == "import"
    assert reader.metadata["config_sha256"] == config.digest()
    assert reader.attachments["calibration.json"] == b'{"rms_px": 0.05}'
    assert not reader.truncated


def test_attached_toml_is_the_same_configuration(
    tmp_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    from avionics.config.load import load_config

    write_all(tmp_path / "a.mcap", config, one_of_each)
    (tmp_path / "c.toml").write_bytes(LogReader(tmp_path / "a.mcap").attachments["config.toml"])
    assert load_config(tmp_path / "c.toml") == config


def test_log_time_is_arrival_in_utc(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    write_all(log_path, config, one_of_each)
    with log_path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages():
            assert message.log_time == message.publish_time
            assert (message.log_time - UTC_OFFSET_NS - 1_234_567_900_000) % 10_000_000 == 0


def test_image_time_is_mid_exposure_in_utc(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

    write_all(log_path, config, one_of_each)
    with log_path.open("rb") as file:
        ((_, _, message),) = make_reader(file).iter_messages(topics=["/camera/root/image"])
    stamp = CompressedImage.FromString(message.data).timestamp
    frame = one_of_each[2]
    assert stamp.seconds * 10**9 + stamp.nanos == frame.t_ns + UTC_OFFSET_NS
    assert message.sequence == 41


def test_existing_file_is_refused_and_left_alone(log_path: Path, config: Config) -> None:
    log_path.write_bytes(b"precious")
    with pytest.raises(OutputExistsError, match="--force"):
        LogWriter(log_path, config)
    assert log_path.read_bytes() == b"precious"


def test_force_replaces_but_an_open_reader_keeps_the_old(log_path: Path, config: Config) -> None:
    log_path.write_bytes(b"old")
    with log_path.open("rb") as old:
        LogWriter(log_path, config, force=True).close()
        assert old.read() == b"old"
    assert LogReader(log_path).config == config


@pytest.mark.parametrize("name", ["missing/flight.mcap", "."])
def test_impossible_path_is_a_clear_error(tmp_path: Path, config: Config, name: str) -> None:
    with pytest.raises(RecordingError, match=r"folder"):
        LogWriter(tmp_path / name, config)


def test_write_after_close_is_an_error(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    writer = LogWriter(log_path, config)
    writer.close()
    writer.close()
    with pytest.raises(RecordingError, match="closed"):
        writer.write(one_of_each[0], 0)


def test_arrival_before_1970_is_an_error(
    log_path: Path, config: Config, one_of_each: list[Record]
) -> None:
    with LogWriter(log_path, config) as writer, pytest.raises(RecordingError, match="1970"):
        writer.write(one_of_each[0], -1)


def test_images_can_be_left_out(log_path: Path, config: Config, one_of_each: list[Record]) -> None:
    recorder = config.recorder.model_copy(update={"images": False})
    write_all(log_path, config.model_copy(update={"recorder": recorder}), one_of_each)
    assert not list(LogReader(log_path).messages(["/camera/*/image"]))
