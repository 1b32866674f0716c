import errno
import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from avionics.config import Config
from avionics.errors import OutputExistsError, RecordingError
from avionics.recording import LogReader, LogWriter, Recorder
from avionics.recording.mcap import logfile
from avionics.records import Event, Health
from drivers.samples import Frame, ImuSample


def sample(number: int) -> ImuSample:
    return ImuSample(number * 5_000_000, "0", number, np.full(3, number / 7))


def frame(number: int) -> Frame:
    return Frame(number * 5_000_000, "root", number, np.full((8, 8), number % 256, np.uint8))


def send(recorder: Recorder, record: ImuSample | Frame) -> None:
    recorder.write(record, record.t_ns)


def with_recorder(config: Config, **changes: Any) -> Config:
    return config.model_copy(update={"recorder": config.recorder.model_copy(update=changes)})


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Storage that stands still until the gate opens."""
    opened = threading.Event()
    write = LogWriter.write

    def slow(self: LogWriter, *args: Any) -> None:
        assert opened.wait(60)
        write(self, *args)

    monkeypatch.setattr(LogWriter, "write", slow)
    return opened


def test_everything_arrives_in_order(log_path: Path, config: Config) -> None:
    with Recorder(log_path, config, utc_offset_ns=5) as recorder:
        for number in range(1000):
            send(recorder, sample(number))
    reader = LogReader(log_path)
    found = [item.record for item in reader.messages(["/imu/0"])]
    assert [r.seq for r in found] == list(range(1000))
    assert not reader.truncated
    assert recorder.counters["written"] >= 1000


def test_slow_storage_never_blocks_and_images_go_first(
    log_path: Path, config: Config, gate: threading.Event
) -> None:
    # GIVEN a queue of 100 records before storage that stands still
    recorder = Recorder(log_path, with_recorder(config, queue_records=100), utc_offset_ns=0)
    # WHEN ten images and more gyro samples come than fit; the writer may hold a batch already
    for number in range(300):
        send(recorder, frame(number) if number % 30 == 29 else sample(number))
    # THEN the calls came back, every waiting image made room, and the rest is counted
    counters = recorder.counters
    assert counters["queue_peak"] == 100
    assert counters["dropped_records"] > 0
    assert counters["dropped_images"] >= 9
    gate.set()
    recorder.close()
    found = [item.record for item in LogReader(log_path).messages()]
    gyros = [r for r in found if isinstance(r, ImuSample)]
    images = [r for r in found if isinstance(r, Frame)]
    assert len(gyros) == 290 - counters["dropped_records"]
    assert len(images) == 10 - counters["dropped_images"]
    assert [r.seq for r in gyros] == sorted(r.seq for r in gyros)


def test_waiting_images_are_bounded(log_path: Path, config: Config, gate: threading.Event) -> None:
    recorder = Recorder(log_path, config, utc_offset_ns=0)
    for number in range(300):
        send(recorder, frame(number))
    assert recorder.counters["dropped_images"] >= 300 - 64 - 32
    gate.set()
    recorder.close()


def test_losses_are_in_the_log_as_health(
    log_path: Path, config: Config, gate: threading.Event
) -> None:
    recorder = Recorder(log_path, with_recorder(config, queue_records=10), utc_offset_ns=0)
    for number in range(500):
        send(recorder, sample(number))
    gate.set()
    recorder.close()
    reports = [i.record for i in LogReader(log_path).messages(["/health"])]
    assert isinstance(reports[-1], Health)
    assert reports[-1].source == "recorder"
    assert reports[-1].counters["dropped_records"] == recorder.counters["dropped_records"] > 0


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A disk with room for so many bytes; the call that crosses the end is cut short."""
    state: dict[str, Any] = {"room": None, "refused": threading.Event()}
    write = os.write

    def limited(descriptor: int, data: Any) -> int:
        if state["room"] is None:
            return write(descriptor, data)
        if state["room"] <= 0:
            state["refused"].set()
            raise OSError(errno.ENOSPC, "No space left on device")
        done = write(descriptor, data[: state["room"]])
        state["room"] -= done
        return done

    monkeypatch.setattr(logfile.os, "write", limited)
    return state


def test_a_full_disk_is_reported_and_everything_returns_with_space(
    log_path: Path, config: Config, disk: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    # GIVEN a flight that runs into a full disk in the middle of a chunk
    recorder = Recorder(log_path, config, utc_offset_ns=0)
    disk["room"] = 100
    for number in range(400):
        send(recorder, sample(number))
    assert disk["refused"].wait(60)
    # WHEN space comes back
    disk["room"] = None
    for number in range(400, 800):
        send(recorder, sample(number))
    recorder.close()
    # THEN nothing is lost, the trouble is in the log, and the stock reader agrees
    reader = LogReader(log_path)
    found = [item.record for item in reader.messages()]
    assert [r.seq for r in found if isinstance(r, ImuSample)] == list(range(800))
    (event,) = (r for r in found if isinstance(r, Event))
    assert "No space left" in event.message
    assert "No space left" in caplog.text
    with log_path.open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages("/imu/0")) == 800


def test_a_disk_that_stays_full_loses_counted_records_and_says_so(
    log_path: Path, config: Config, disk: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logfile, "MAX_PENDING_BYTES", 2000)
    recorder = Recorder(log_path, config, utc_offset_ns=0)
    for number in range(100):
        send(recorder, sample(number))
    while recorder.counters.get("written", 0) < 80:
        pass
    disk["room"] = 0
    for number in range(100, 2000):
        send(recorder, sample(number))
    with pytest.raises(RecordingError):
        recorder.close()
    assert recorder.counters["dropped_storage"] > 0
    reader = LogReader(log_path)
    assert reader.truncated
    seqs = [item.record.seq for item in reader.messages(["/imu/0"])]
    assert seqs == list(range(len(seqs)))


def test_a_log_written_in_one_thread_stops_at_a_full_disk(
    log_path: Path, config: Config, disk: dict[str, Any]
) -> None:
    writer = LogWriter(log_path, config)
    disk["room"] = 0
    for number in range(40):
        writer.write(sample(number), number * 5_000_000)
    with pytest.raises(RecordingError, match="No space left"):
        writer.write(sample(40), 40 * 5_000_000)
    with pytest.raises(RecordingError, match="No space left"):
        writer.close()
    assert LogReader(log_path).config == config


def test_a_record_that_cannot_be_written_is_counted(log_path: Path, config: Config) -> None:
    with Recorder(log_path, config, utc_offset_ns=0) as recorder:
        bad = Frame(0, "root", 0, np.zeros((0, 0), np.uint8))
        recorder.write(bad, 0)
        send(recorder, sample(1))
    assert recorder.counters["dropped_unwritable"] == 1
    assert len(list(LogReader(log_path).messages(["/imu/0"]))) == 1


def test_records_after_close_are_counted_not_raised(log_path: Path, config: Config) -> None:
    recorder = Recorder(log_path, config, utc_offset_ns=0)
    recorder.close()
    recorder.close()
    send(recorder, sample(0))
    assert recorder.counters["dropped_records"] == 1


def test_recorder_refuses_an_existing_file(log_path: Path, config: Config) -> None:
    log_path.write_bytes(b"precious")
    with pytest.raises(OutputExistsError):
        Recorder(log_path, config, utc_offset_ns=0)
