from pathlib import Path

import numpy as np
import pytest

from avionics.analysis.flight import read_flight
from avionics.analysis.info import info_text, log_info
from avionics.config import Config
from avionics.recording import LogWriter
from avionics.records import Event, Health, MarkerTracks
from drivers.samples import Frame, ImuSample


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.mcap"
    config = Config.model_validate({"wing": {"span_m": 1.5, "name": "left"}})
    with LogWriter(path, config, metadata={"command": "sim"}) as writer:
        for number in range(101):
            t_ns = number * 10_000_000
            if number not in (7, 50, 51):
                sample = ImuSample(t_ns, "0", number, np.zeros(3))
                writer.write(sample, t_ns)
            if number % 10 == 0 and number != 30:
                frame = Frame(t_ns, "root", number // 10, np.zeros((8, 8), np.uint8))
                writer.write(frame, t_ns)
                found = np.array([True, number >= 50])
                tracks = MarkerTracks(t_ns, "root", 0, np.zeros((2, 2)), np.ones(2), found)
                writer.write(tracks, t_ns)
        for record in (
            Health(0, "can0", {"frames": 3, "errors": 0}),
            Health(0, "can0", {"frames": 9, "errors": 0}),
            Event(5, "pod 1", "error", "silent"),
        ):
            writer.write(record, 10**9)
    return path


def test_counts_rates_and_losses(log: Path) -> None:
    info = log_info(read_flight(log))
    imu = info.topics["/imu/0"]
    assert (imu.count, imu.lost) == (98, 3)
    assert imu.rate_hz == pytest.approx(97.0)
    assert info.topics["/camera/root/image"].lost == 1
    assert info.duration_s == pytest.approx(1.0)
    assert info.counters == {"can0": {"frames": 9, "errors": 0}}
    assert [event.message for event in info.events] == ["silent"]
    assert info.topics["/camera/root/tracks"].note == "80.0% of markers found"


def test_text_says_what_flew(log: Path) -> None:
    text = info_text(read_flight(log))
    for words in ("wing 'left'", "command: sim", "/imu/0", "config.toml", "silent", "complete"):
        assert words in text


def test_cut_log_is_said_to_be_cut(log: Path) -> None:
    log.write_bytes(log.read_bytes()[:-300])
    assert "cut, or never closed" in info_text(read_flight(log))
    assert log_info(read_flight(log)).damage.truncated


def test_damaged_configuration_is_said(log: Path) -> None:
    data = bytearray(log.read_bytes())
    data[data.index(b'"span_m"') + 1] ^= 1
    log.write_bytes(data)
    assert "config.json is missing or damaged" in info_text(read_flight(log))
