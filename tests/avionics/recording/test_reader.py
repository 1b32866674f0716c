"""What a reader found once, found again by its place in the file."""

from pathlib import Path

import pytest
from google.protobuf.message import DecodeError

from avionics.recording import LogReader
from avionics.recording.schema.decode import DECODER_OF, exposure_ns
from tests.avionics.written_flight import flight_records, write


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    items = flight_records()[:2000]
    return write(tmp_path_factory.mktemp("log") / "flight.mcap", items)


@pytest.mark.parametrize("share", [1.0, 0.7])
def test_a_message_is_found_again_at_its_offset(log: Path, tmp_path: Path, share: float) -> None:
    """GIVEN a whole log, and one cut in the middle of a chunk."""
    data = log.read_bytes()
    path = tmp_path / "a.mcap"
    path.write_bytes(data[: int(len(data) * share)])
    reader = LogReader(path)
    found = list(reader.raw_messages())
    offsets = {one.offset for one in found}
    assert 1 < len(offsets) < len(found)
    again = [message for at in sorted(offsets) for message in reader.messages_at(at)]
    assert again == [one.message for one in found]


def test_exposure_is_read_without_the_picture(log: Path) -> None:
    name = "foxglove.CompressedImage"
    reader = LogReader(log)
    images = list(reader.raw_messages(lambda _, schema: schema is not None and schema.name == name))
    assert len(images) > 10
    for offset_ns in (0, 1_700_000_000_000_000_001):
        for image in images:
            data = image.message.data
            assert exposure_ns(data, offset_ns) == DECODER_OF[name](data, 0, offset_ns).t_ns
    with pytest.raises(DecodeError):
        exposure_ns(b"\x0a\x7fno time", 0)
    assert exposure_ns(b"", 0) == 0
