"""A log written by a process of its own is the log that ``LogWriter`` writes."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from avionics.errors import OutputExistsError, RecordingError
from avionics.flight.estimate_rows import row_batch
from avionics.flight.pipelines import Pipelines
from avionics.recording import LogReader, LogWriter
from avionics.recording.log_process import LogProcess
from drivers.samples import Frame, ImuSample
from tests.avionics.wse.flight import Flight, Truth, make_config, swing

OPTIONS = {"utc_offset_ns": 10**18, "metadata": {"a": "b"}, "attachments": {"x.csv": b"1"}}


@pytest.fixture(scope="module")
def flight() -> Flight:
    truth = Truth(bending=swing(0.3, 1.3, rest=0.1), twist=swing(0.08, 1.7))
    return Flight(make_config(), truth, duration_s=2.0)


def fly(flight: Flight, writer) -> None:
    with writer:
        pipeline = Pipelines(flight.config, writer)
        for arrival_ns, record in flight.events():
            if isinstance(record, ImuSample):
                pipeline.on_imu(record, arrival_ns)
            else:
                image = np.full((8, 8), record.frame_index % 256, dtype=np.uint8)
                frame = Frame(record.t_ns, record.camera, record.frame_index, image)
                pipeline.pass_on(frame, arrival_ns)
                pipeline.on_tracks(record, arrival_ns)
        pipeline.close()


def test_both_write_the_same_bytes(tmp_path: Path, flight: Flight) -> None:
    fly(flight, LogWriter(tmp_path / "here.mcap", flight.config, **OPTIONS))
    fly(flight, LogProcess(tmp_path / "apart.mcap", flight.config, **OPTIONS))
    apart = (tmp_path / "apart.mcap").read_bytes()
    assert len(apart) > 100_000
    assert apart == (tmp_path / "here.mcap").read_bytes()


def test_what_the_process_cannot_do_is_raised_here(tmp_path: Path, flight: Flight) -> None:
    path = tmp_path / "there.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(OutputExistsError, match=r"there\.mcap"):
        fly(flight, LogProcess(path, flight.config))
    assert path.read_bytes() == b"precious"
    with pytest.raises(RecordingError, match="nowhere"):
        fly(flight, LogProcess(tmp_path / "nowhere" / "a.mcap", flight.config))


def test_a_killed_process_is_an_error_and_no_endless_wait(tmp_path: Path, flight: Flight) -> None:
    writer = LogProcess(tmp_path / "a.mcap", flight.config)
    (child,) = (
        int(pid)
        for task in Path("/proc/self/task").glob("*/children")
        for pid in task.read_text().split()
        if b"log_process" in Path(f"/proc/{pid}/cmdline").read_bytes()
    )
    os.kill(child, signal.SIGKILL)
    with pytest.raises(RecordingError, match=r"a\.mcap: .* signal 9"):
        fly_for_ever(writer)


def fly_for_ever(writer: LogProcess) -> None:
    while True:
        writer.take(row_batch([], []), [])


PARENT = """
import sys
from pathlib import Path
from avionics.recording.log_process import LogProcess
from tests.avionics.recording.test_log_process import Flight, Truth, fly, make_config, swing

def wait_to_be_killed():
    with writer._room:
        writer._room.wait_for(lambda: writer._waiting_bytes == 0)
    print("flown", flush=True)
    sys.stdin.read()

truth = Truth(bending=swing(0.3, 1.3), twist=swing(0.1, 2.0))
flight = Flight(make_config(), truth, duration_s=2.0)
writer = LogProcess(Path(sys.argv[1]), flight.config)
writer.close = wait_to_be_killed
fly(flight, writer)
"""


def test_log_is_whole_when_the_parent_was_killed(tmp_path: Path) -> None:
    # GIVEN a replay that has handed on all it has, and has not closed its log
    path = tmp_path / "a.mcap"
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[3],
        stderr=subprocess.PIPE,
    )
    with parent:
        assert parent.stdout.readline() == b"flown\n"
        # WHEN it is killed
        parent.kill()
        # THEN the other one ends the log: its copy of our pipe closes
        assert parent.stderr.read() == b""
    reader = LogReader(path)
    assert not reader.truncated
    assert sum(1 for m in reader.messages(["/wing/*/estimate_crg"])) > 150
