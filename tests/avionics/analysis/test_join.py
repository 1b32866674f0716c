"""Joining logs: the truth lands on the flight's clock, and what does not belong is refused."""

from pathlib import Path

import numpy as np
import pytest

from avionics.analysis.join import join
from avionics.config.load import default_config_text, parse_config_text
from avionics.errors import JoinError, RecordingError
from avionics.recording import LogReader, LogWriter
from avionics.records import Truth
from drivers.samples import ImuSample

SECOND = 1_000_000_000
UTC = 1_700_000_000 * SECOND


@pytest.fixture
def config():
    return parse_config_text(default_config_text(), (), origin="packaged")


def motion(t_s):
    return 2.0 * np.sin(2 * np.pi * (0.3 * t_s + 0.02 * t_s**2))


def sample(t_ns: int, rate: float, seq: int) -> ImuSample:
    return ImuSample(t_ns, "0", seq, np.array([rate, 0.1 * rate, 0.0]), None, None)


def truth_log(path: Path, config, *, markers: int = 6, boot: str = "A", role: str = "truth"):
    """Ten seconds of truth from 100 s on; every marker's z tells the time."""
    metadata = {"role": role, "boot_id": boot, "scenario": "x", "seed": "0"}
    with LogWriter(path, config, utc_offset_ns=UTC, metadata=metadata) as writer:
        for k in range(1000):
            t_s = 100 + 0.01 * k
            t_ns = round(t_s * SECOND)
            truth = Truth(t_ns, "right", "sim", np.full((markers, 3), t_s - 100))
            felt = sample(t_ns, motion(t_s - 100), k)
            for record in (truth, felt):
                writer.write(record, t_ns)


def flight_log(path: Path, config, *, offset_s: float = 0.0, boot: str = "A"):
    """Six seconds of gyro samples from 102 s on, on a clock that is ``offset_s`` ahead."""
    lag_s = 2**0.5 / (2 * np.pi * config.pods[0].chip.gyro_bandwidth_hz) + 0.5 / 400
    with LogWriter(path, config, utc_offset_ns=UTC, metadata={"boot_id": boot}) as writer:
        for k in range(600):
            t_s = 102 + 0.01 * k
            t_ns = round((t_s + offset_s + lag_s) * SECOND)
            record = sample(t_ns, motion(t_s - 100), k)
            writer.write(record, t_ns)


def truths(path: Path) -> list[Truth]:
    return [m.record for m in LogReader(path).messages(["/wing/*/truth"])]


def test_one_machine_shares_its_clock(config, tmp_path: Path) -> None:
    flight_log(tmp_path / "f.mcap", config)
    truth_log(tmp_path / "t.mcap", config)
    report = join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "o.mcap")
    assert report.method == "shared clock"
    assert report.check_s == pytest.approx(0.0, abs=1e-3)
    found = truths(tmp_path / "o.mcap")
    assert report.truths == len(found) > 600
    for truth in found:
        assert truth.marker_in_body_m[0, 2] == pytest.approx(truth.t_ns / SECOND - 100, abs=1e-6)
    arrivals = [m.arrival_ns for m in LogReader(tmp_path / "o.mcap").messages()]
    assert arrivals == sorted(arrivals)


def test_other_machine_is_aligned_by_its_gyros(config, tmp_path: Path) -> None:
    flight_log(tmp_path / "f.mcap", config, offset_s=777.125, boot="B")
    truth_log(tmp_path / "t.mcap", config)
    report = join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "o.mcap")
    assert report.method == "gyro rates"
    assert report.offset_s == pytest.approx(777.125, abs=1e-3)
    assert 0 < report.sigma_s < 2e-3
    for truth in truths(tmp_path / "o.mcap"):
        t_s = truth.t_ns / SECOND - 777.125 - 100
        assert truth.marker_in_body_m[0, 2] == pytest.approx(t_s, abs=2e-3)


def test_two_flights_are_refused(config, tmp_path: Path) -> None:
    flight_log(tmp_path / "f.mcap", config)
    truth_log(tmp_path / "t.mcap", config, role="flight")
    with pytest.raises(JoinError, match="is no truth"):
        join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "o.mcap")
    assert not (tmp_path / "o.mcap").exists()


def test_exchanged_arguments_are_refused(config, tmp_path: Path) -> None:
    truth_log(tmp_path / "t.mcap", config)
    truth_log(tmp_path / "u.mcap", config)
    with pytest.raises(JoinError, match="give the flight first"):
        join(tmp_path / "t.mcap", tmp_path / "u.mcap", tmp_path / "o.mcap")


def test_joined_flight_is_not_joined_again(config, tmp_path: Path) -> None:
    flight_log(tmp_path / "f.mcap", config)
    truth_log(tmp_path / "t.mcap", config)
    join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "o.mcap")
    with pytest.raises(JoinError, match=r"o\.mcap: is joined already, with t\.mcap"):
        join(tmp_path / "o.mcap", tmp_path / "t.mcap", tmp_path / "p.mcap")
    assert not (tmp_path / "p.mcap").exists()


def test_other_markers_are_refused(config, tmp_path: Path) -> None:
    flight_log(tmp_path / "f.mcap", config)
    fewer = config.model_copy(update={"markers": config.markers[:4]})
    truth_log(tmp_path / "t.mcap", fewer, markers=4)
    with pytest.raises(JoinError, match="6 markers"):
        join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "o.mcap")


def test_output_may_not_be_an_input(config, tmp_path: Path) -> None:
    flight_log(tmp_path / "f.mcap", config)
    truth_log(tmp_path / "t.mcap", config)
    with pytest.raises(RecordingError, match="is the log itself"):
        join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "f.mcap", force=True)


def test_output_that_failed_is_removed(config, tmp_path: Path) -> None:
    # GIVEN a flight and a truth of one machine, of different hours
    flight_log(tmp_path / "f.mcap", config, offset_s=5000.0)
    truth_log(tmp_path / "t.mcap", config)
    output = tmp_path / "o.mcap"
    # WHEN they are joined THEN that is refused, and nothing looks like a result
    with pytest.raises(JoinError, match="no truth of the time"):
        join(tmp_path / "f.mcap", tmp_path / "t.mcap", output, alignment="shared")
    assert not output.exists()


@pytest.mark.parametrize("share", [0.6, 0.95])
def test_truth_that_is_not_closed_is_joined_as_far_as_it_goes(
    config, tmp_path: Path, share: float
) -> None:
    flight_log(tmp_path / "f.mcap", config)
    truth_log(tmp_path / "whole.mcap", config)
    data = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "t.mcap").write_bytes(data[: round(share * len(data))])
    report = join(tmp_path / "f.mcap", tmp_path / "t.mcap", tmp_path / "o.mcap", alignment="shared")
    assert not report.is_truth_closed
    assert "rig stop" in report.text()
    assert report.truths == len(truths(tmp_path / "o.mcap")) > 100
