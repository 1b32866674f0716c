import os
import random
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from avionics.config import Config
from avionics.errors import ConfigError, RecordingError
from avionics.recording import LogReader, LogWriter, recover
from avionics.recording.mcap.damage import Damage
from avionics.recording.mcap.scan import open_log, records
from drivers.samples import Frame, ImuSample

STEP_NS = 5_000_000
COUNT = 600


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, config: Config) -> Path:
    """Three seconds: two gyros at 200 Hz in all, some images."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    rng = np.random.default_rng(3)
    with LogWriter(path, config, utc_offset_ns=10**18) as writer:
        for number in range(COUNT):
            t_ns = number * STEP_NS
            sample = ImuSample(t_ns, str(number % 2), number // 2, rng.normal(size=3))
            writer.write(sample, t_ns)
            if number % 40 == 0:
                image = rng.integers(0, 256, (120, 160), dtype=np.uint8)
                frame = Frame(t_ns, "root", number // 40, image)
                writer.write(frame, t_ns)
    return path


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """(offset of the end, messages so far that are ours) of every chunk, by the stock reader."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    ends = []
    for chunk in summary.chunk_indexes:
        end_ns = chunk.message_end_time - 10**18
        imu = end_ns // STEP_NS + 1
        ends.append((chunk.chunk_start_offset + chunk.chunk_length, imu))
    return ends


def cut(source: Path, target: Path, size: int) -> Path:
    target.write_bytes(source.read_bytes()[:size])
    return target


def test_chunks_are_bounded_in_time(whole: Path, config: Config) -> None:
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) >= 3.0 / 0.2
    longest = max(c.message_end_time - c.message_start_time for c in summary.chunk_indexes)
    assert longest <= config.recorder.chunk_s * 1e9


def test_cut_anywhere_gives_everything_whole(whole: Path, tmp_path: Path) -> None:
    size = whole.stat().st_size
    ends = chunk_ends(whole)
    rng = random.Random(0)
    edges = [end + step for end, _ in ends for step in (-1, 0, 1)]
    cuts = sorted({*rng.sample(range(ends[0][0], size), 60), *edges, size - 1, size - 8})
    for at in cuts:
        reader = LogReader(cut(whole, tmp_path / "cut.mcap", at))
        found = [item.record for item in reader.messages(["/imu/*"])]
        certain = max((count for end, count in ends if end <= at), default=0)
        assert len(found) >= certain, at
        assert [r.t_ns for r in found] == [n * STEP_NS for n in range(len(found))], at
        assert reader.truncated, at
        assert reader.damage.truncated, at


def test_cut_in_the_head_is_a_clear_error(whole: Path, tmp_path: Path) -> None:
    with whole.open("rb") as file:
        first = make_reader(file).get_summary().chunk_indexes[0].chunk_start_offset
    for at in [*range(1, 120, 7), *range(120, first, 97)]:
        path = cut(whole, tmp_path / "cut.mcap", at)
        try:
            reader = LogReader(path)
            assert not list(reader.messages())
            assert reader.config.wing.span_m > 0
        except (RecordingError, ConfigError) as error:
            assert str(path) in str(error)  # noqa: PT017  # either outcome is right


@pytest.mark.parametrize("share", [0.35, 0.6, 0.97])
def test_recover_makes_a_cut_log_readable_for_the_stock_reader(
    whole: Path, tmp_path: Path, share: float
) -> None:
    broken = cut(whole, tmp_path / "cut.mcap", int(whole.stat().st_size * share))
    ours = [item.record for item in LogReader(broken).messages(["/imu/*"])]
    recovery = recover(broken, tmp_path / "fixed.mcap")
    with (tmp_path / "fixed.mcap").open("rb") as file:
        stock = make_reader(file)
        times = [m.log_time - 10**18 for _, c, m in stock.iter_messages() if "/imu/" in c.topic]
        attachments = {a.name for a in stock.iter_attachments()}
    assert times == [record.t_ns for record in ours]
    assert attachments == {"config.json", "config.toml"}
    assert recovery.damage.truncated
    assert recovery.messages >= len(ours)
    fixed = LogReader(tmp_path / "fixed.mcap")
    assert not fixed.truncated
    assert fixed.config == LogReader(whole).config
    assert len(list(fixed.messages(["/imu/*"]))) == len(ours)


def test_recover_keeps_a_whole_log_whole(whole: Path, tmp_path: Path) -> None:
    recovery = recover(whole, tmp_path / "fixed.mcap")
    assert recovery.damage == Damage()
    a = [(i.topic, i.arrival_ns, i.record.t_ns) for i in LogReader(whole).messages()]
    b = [
        (i.topic, i.arrival_ns, i.record.t_ns)
        for i in LogReader(tmp_path / "fixed.mcap").messages()
    ]
    assert a == b


def test_recover_refuses_its_own_input(whole: Path) -> None:
    before = whole.read_bytes()
    with pytest.raises(RecordingError, match="is the log itself"):
        recover(whole, whole, force=True)
    assert whole.read_bytes() == before


def test_recover_of_nothing_leaves_no_file(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nothing"):
        recover(cut(whole, tmp_path / "cut.mcap", 12), tmp_path / "fixed.mcap")
    assert not (tmp_path / "fixed.mcap").exists()


def test_flipped_bits_are_counted_never_raised(whole: Path, tmp_path: Path) -> None:
    clean = whole.read_bytes()
    expected = {(i.topic, i.arrival_ns, i.record.t_ns) for i in LogReader(whole).messages()}
    rng = random.Random(1)
    path = tmp_path / "flipped.mcap"
    for _ in range(150):
        data = bytearray(clean)
        at = rng.randrange(len(data))
        data[at] ^= 1 << rng.randrange(8)
        path.write_bytes(data)
        try:
            reader = LogReader(path)
            assert reader.config is not None
            found = {(i.topic, i.arrival_ns, i.record.t_ns) for i in reader.messages()}
        except (RecordingError, ConfigError) as error:
            assert str(path) in str(error)  # noqa: PT017  # either outcome is right
            continue
        if reader.utc_offset_ns == 10**18:
            assert len(found) > 0.8 * len(expected)
            assert found <= expected, at
            assert found == expected or reader.damage != Damage(), at


def test_a_damaged_chunk_costs_only_itself(whole: Path, tmp_path: Path) -> None:
    with whole.open("rb") as file:
        chunk = make_reader(file).get_summary().chunk_indexes[4]
    for at in (60, 1, 30):  # contents, length, sizes
        data = bytearray(whole.read_bytes())
        data[chunk.chunk_start_offset + at] ^= 0x40
        (tmp_path / "hurt.mcap").write_bytes(data)
        reader = LogReader(tmp_path / "hurt.mcap")
        lost = COUNT - sum(1 for _ in reader.messages(["/imu/*"]))
        assert 0 < lost <= 41
        assert reader.damage.damaged_chunks + reader.damage.skipped_bytes > 0
        assert not reader.damage.truncated


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"t_ns,pod,gx\n1,2,3\n", "is not an MCAP log"),
        (b"\x89MCAP", "was cut after 5 bytes"),
    ],
)
def test_what_is_no_log_is_a_clear_error(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words) as caught:
        LogReader(path)
    assert str(path) in str(caught.value)


def test_missing_and_unreadable_files_are_clear_errors(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be opened"):
        LogReader(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match="cannot be"):
        LogReader(tmp_path)


def test_foreign_mcap_is_named_as_such(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(RecordingError, match="not a log of this program"):
        LogReader(path)


CHILD = """
    import os, sys, time
    from pathlib import Path
    import numpy as np
    from avionics.config import Config
    from avionics.recording import Recorder
    from drivers.samples import ImuSample

    config = Config.model_validate({"wing": {"span_m": 1.5}})
    recorder = Recorder(Path(sys.argv[1]), config, utc_offset_ns=0)
    begin = time.monotonic_ns()
    number = 0
    while True:
        now = time.monotonic_ns()
        while begin + number * 5_000_000 <= now:
            t = begin + number * 5_000_000
            recorder.write(ImuSample(t, "0", number, np.zeros(3)), t)
            number += 1
        os.write(1, number.to_bytes(8, "little"))
        time.sleep(0.002)
"""


def test_sigkill_costs_at_most_half_a_second(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(CHILD), str(path)], stdout=subprocess.PIPE
    )
    assert child.stdout is not None
    written = 0
    while written < 500:  # 2.5 s at 200 Hz
        written = int.from_bytes(child.stdout.read(8), "little")
    os.kill(child.pid, signal.SIGKILL)
    rest = child.stdout.read()
    child.stdout.close()
    child.wait()
    if len(rest) >= 8:
        written = int.from_bytes(rest[len(rest) // 8 * 8 - 8 : len(rest) // 8 * 8], "little")
    reader = LogReader(path)
    found = [item.record for item in reader.messages(["/imu/0"])]
    assert reader.truncated
    assert [record.seq for record in found] == list(range(len(found)))
    assert written - len(found) <= 100  # 0.5 s at 200 Hz
    recover(path, tmp_path / "fixed.mcap")
    with (tmp_path / "fixed.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages("/imu/0")) == len(found)
    with (tmp_path / "fixed.mcap").open("rb") as file:
        assert any(True for _ in StreamReader(file, validate_crcs=True).records)


def test_log_that_grows_is_read_up_to_its_size_at_the_start(whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    places = random.Random(5).sample(range(3000, len(data)), 40)
    (end, _), *_ = chunk_ends(whole)
    for size in (*places, end, end - 1, end + 1, end + 9):
        path = cut(whole, tmp_path / "grows.mcap", size)
        cut_off, grown = Damage(), Damage()
        with open_log(path) as file:
            wanted = list(records(file, cut_off))
        with open_log(path) as file:
            iterator = records(file, grown)
            found = [next(iterator)]
            with path.open("ab") as writer:
                writer.write(data[size:])
            found += iterator
        assert found == wanted, size
        assert grown.skipped_bytes == cut_off.skipped_bytes >= 0
