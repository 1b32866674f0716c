"""Our container against the library: its writer makes the same bytes, its reader finds its way."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from avionics.config import Config
from avionics.recording import LogReader, LogWriter
from avionics.recording.mcap.container import Container
from avionics.recording.mcap.logfile import LogFile
from avionics.topics import Record, topic_of
from tests.avionics.recording.conftest import make_records

CHUNK_NS = 200_000_000
RECORD_NS = 7_000_000


def library_writer(file: LogFile, library: str) -> Writer:
    writer = Writer(
        file,  # type: ignore[arg-type]  # the library uses write, tell and flush only
        chunk_size=1 << 40,
        compression=CompressionType.ZSTD,
    )
    writer.start(profile="", library=library)
    return writer


@pytest.mark.parametrize("seed", range(3))
def test_same_calls_on_the_librarys_writer_give_the_same_bytes(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    ours_file, theirs_file = LogFile(tmp_path / "ours"), LogFile(tmp_path / "theirs")
    ours, theirs = Container(ours_file, library="x"), library_writer(theirs_file, "x")
    for name in ("a", "b")[: rng.integers(1, 3)]:
        ours.add_metadata(name, {"k": "v", "ä": "€"})
        theirs.add_metadata(name, {"k": "v", "ä": "€"})
        data = rng.bytes(rng.integers(0, 100))
        ours.add_attachment(name, "text/csv", data)
        theirs.add_attachment(0, 0, name, "text/csv", data)
    channels: dict[int, int] = {}
    for _ in range(200):
        topic, schema = int(rng.integers(0, 9)), int(rng.integers(0, 3)) + 1
        if topic not in channels:
            if len(channels) < 3:
                assert ours.register_schema(
                    f"s{topic}", "protobuf", b"d"
                ) == theirs.register_schema(f"s{topic}", "protobuf", b"d")
            channels[topic] = ours.register_channel(f"/{topic}", "protobuf", schema)
            assert channels[topic] == theirs.register_channel(f"/{topic}", "protobuf", schema)
        if rng.random() < 0.05:
            # Right after a channel was made the chunk holds no message, and waits.
            ours.flush()
            theirs.flush()  # type: ignore[no-untyped-call]
        log_ns, sequence = (
            int(rng.integers(0, 1 << 64, dtype=np.uint64)),
            int(rng.integers(1 << 32)),
        )
        data = rng.bytes(rng.integers(0, 300))
        ours.add_message(channels[topic], sequence, log_ns, data)
        theirs.add_message(channels[topic], log_ns, data, log_ns, sequence)
    ours.finish()
    theirs.finish()  # type: ignore[no-untyped-call]
    for file in (ours_file, theirs_file):
        file.commit()
        file.close()
    assert (tmp_path / "ours").read_bytes() == (tmp_path / "theirs").read_bytes()


def test_a_log_without_messages_is_what_the_library_makes(tmp_path: Path) -> None:
    ours_file, theirs_file = LogFile(tmp_path / "ours"), LogFile(tmp_path / "theirs")
    Container(ours_file, library="x").finish()
    library_writer(theirs_file, "x").finish()  # type: ignore[no-untyped-call]
    for file in (ours_file, theirs_file):
        file.commit()
        file.close()
    assert (tmp_path / "ours").read_bytes() == (tmp_path / "theirs").read_bytes()


@pytest.fixture
def written(config: Config, log_path: Path) -> list[tuple[str, Record, int]]:
    """Some seconds of every record, 7 ms apart, in the log at ``log_path``."""
    made = []
    with LogWriter(log_path, config, attachments={"a.csv": b"1"}) as writer:
        for repeat in range(40):
            for number, record in enumerate(make_records(np.random.default_rng(repeat))):
                arrival_ns = (repeat * 11 + number) * RECORD_NS
                writer.write(record, arrival_ns)
                made.append((topic_of(record), record, arrival_ns))
    return made


def test_summary_counts_what_was_written(
    log_path: Path, written: list[tuple[str, Record, int]]
) -> None:
    with log_path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    topics = {number: channel.topic for number, channel in summary.channels.items()}
    counts = {topics[n]: c for n, c in summary.statistics.channel_message_counts.items()}
    records = Counter(topic for topic, _, _ in written)
    assert {topic: counts[topic] for topic in records} == records
    assert summary.statistics.message_count == sum(counts.values())
    assert summary.statistics.message_start_time == 0
    assert summary.statistics.message_end_time == written[-1][2]
    assert summary.statistics.chunk_count == len(summary.chunk_indexes)
    assert summary.statistics.attachment_count == len(summary.attachment_indexes) == 3
    assert summary.statistics.metadata_count == len(summary.metadata_indexes) == 1
    assert summary.statistics.schema_count == len(summary.schemas)


def test_chunks_follow_each_other_and_none_lasts_too_long(
    log_path: Path, written: list[tuple[str, Record, int]]
) -> None:
    with log_path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    chunks = summary.chunk_indexes
    assert len(chunks) >= written[-1][2] // (CHUNK_NS + RECORD_NS)
    for chunk in chunks:
        assert chunk.message_end_time - chunk.message_start_time < CHUNK_NS + RECORD_NS
    for chunk, later in pairwise(chunks):
        assert chunk.message_end_time < later.message_start_time
        behind = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
        assert behind == later.chunk_start_offset


# Newer readers call the bounds starting_at and ending_before, the oldest that we allow does not.
@pytest.mark.filterwarnings("ignore:(start|end)_time is deprecated:DeprecationWarning")
def test_the_librarys_reader_seeks_by_topic_and_time(
    log_path: Path, written: list[tuple[str, Record, int]]
) -> None:
    start_ns, end_ns = 900_000_000, 1_700_000_000
    for topic in ("/imu/0", "/wing/right/estimate_crg", "/event"):
        with log_path.open("rb") as file:
            found = [
                (channel.topic, message.log_time)
                for _, channel, message in make_reader(file, validate_crcs=True).iter_messages(
                    topics=[topic], start_time=start_ns, end_time=end_ns
                )
            ]
        expected = [(t, at) for t, _, at in written if t == topic and start_ns <= at < end_ns]
        assert len(expected) > 5
        assert found == expected


def test_our_reader_and_the_librarys_agree_on_every_message(
    log_path: Path, written: list[tuple[str, Record, int]]
) -> None:
    with log_path.open("rb") as file:
        theirs = [
            (channel.topic, message.sequence, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]
    ours = [
        (item.channel.topic, item.message.sequence, item.message.log_ns, item.message.data)
        for item in LogReader(log_path).raw_messages()
    ]
    assert ours == theirs
    assert len(ours) > len(written)
