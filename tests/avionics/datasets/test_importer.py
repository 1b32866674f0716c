"""Import of data sets: what comes in, and what the log says was left out."""

import numpy as np
import pytest

from avionics.analysis.flight import read_flight
from avionics.analysis.info import log_info
from avionics.datasets.importer import import_set
from avionics.errors import DataSetError
from avionics.recording import LogReader
from avionics.records import Event, Truth
from drivers.samples import Frame, ImuSample
from tests.avionics.conftest import EPOCH_NS

pytestmark = pytest.mark.slow


def records_of(log, kind):
    return [m.record for m in LogReader(log).messages() if isinstance(m.record, kind)]


def test_whole_set_comes_in_by_arrival(whole_set, tmp_path) -> None:
    log = tmp_path / "a.mcap"
    summary = import_set(whole_set.path, log)
    assert summary.notes == []
    reader = LogReader(log)
    arrivals = [m.arrival_ns for m in reader.messages(decode_images=False)]
    assert arrivals == sorted(arrivals)
    frames = records_of(log, Frame)
    assert len(frames) == len(whole_set.lines("frames.csv")) - 1
    assert frames[3].t_ns == EPOCH_NS + 120_000_000
    assert frames[3].image.shape == (240, 320)


def test_counts_become_si_units(whole_set, tmp_path) -> None:
    import_set(whole_set.path, tmp_path / "a.mcap")
    sample = records_of(tmp_path / "a.mcap", ImuSample)[0]
    count = int(whole_set.lines("imu.csv")[1].split(",")[2])
    assert sample.rate_rad_s[0] == pytest.approx(np.radians(count / 16))
    assert sample.specific_force_m_s2[2] == pytest.approx(-9.81)
    assert sample.magnetic_flux_t[0] == pytest.approx(100 / 16 * 1e-6)


def test_motion_capture_becomes_body_axes(whole_set, tmp_path) -> None:
    import_set(whole_set.path, tmp_path / "a.mcap")
    truth = records_of(tmp_path / "a.mcap", Truth)[10]
    t_s = np.array([(truth.t_ns - EPOCH_NS) * 1e-9])
    assert np.allclose(
        truth.marker_in_body_m, whole_set.model.points(whole_set.q(t_s))[0], atol=1e-4
    )


def told(made, tmp_path) -> str:
    """Import a set that can still be used; return what the log says was left out."""
    log = tmp_path / "told.mcap"
    summary = import_set(made.path, log)
    events = " | ".join(event.message for event in records_of(log, Event))
    assert summary.notes
    assert all(note in events for note in summary.notes)
    return events


def test_bad_row_is_left_out_and_told_by_line(made, tmp_path) -> None:
    lines = made.lines("imu.csv")
    lines[5] = lines[5].replace(",0,", ",zero,", 1)
    lines[9] = "17000"
    made.write("imu.csv", lines)
    assert "imu.csv: bad rows: 2 (line 6, 10)" in told(made, tmp_path)


@pytest.mark.parametrize("missing", ["mocap.csv", "frames.csv", "camera.avi"])
def test_optional_files_may_be_absent(made, tmp_path, missing: str) -> None:
    (made.path / missing).unlink()
    import_set(made.path, tmp_path / "a.mcap", calibrate=True)
    kinds = {type(m.record) for m in LogReader(tmp_path / "a.mcap").messages()}
    assert ImuSample in kinds
    assert (Truth in kinds) == (missing != "mocap.csv")
    assert (Frame in kinds) == (missing == "mocap.csv")


@pytest.mark.parametrize("section", ["markers", "mocap", "camera"])
def test_sections_of_the_description_may_be_absent(made, tmp_path, section: str) -> None:
    content = made.yaml()
    del content[section]
    made.write_yaml(content)
    import_set(made.path, tmp_path / "a.mcap")
    assert records_of(tmp_path / "a.mcap", ImuSample)


def test_wrong_picture_size_is_told(made, tmp_path) -> None:
    content = made.yaml()
    content["camera"]["width"] = 640
    made.write_yaml(content)
    with pytest.raises(DataSetError, match="320 x 240"):
        import_set(made.path, tmp_path / "a.mcap")


def test_failed_import_keeps_what_stood_there_and_leaves_no_part(made, tmp_path) -> None:
    log = tmp_path / "a.mcap"
    content = made.yaml()
    content["camera"]["width"] = 321
    made.write_yaml(content)
    with pytest.raises(DataSetError, match="321"):
        import_set(made.path, log)
    assert list(tmp_path.glob("a.mcap*")) == []
    log.write_bytes(b"precious")
    with pytest.raises(DataSetError, match="321"):
        import_set(made.path, log, force=True)
    assert log.read_bytes() == b"precious"
    assert list(tmp_path.glob("a.mcap*")) == [log]


def test_contradiction_in_the_description_is_one_line_of_ours(made, tmp_path) -> None:
    content = made.yaml()
    content["pods"][1]["id"] = content["pods"][0]["id"]
    made.write_yaml(content)
    with pytest.raises(DataSetError, match=r"wing\.yaml: .* are not unique$"):
        import_set(made.path, tmp_path / "a.mcap")


def test_set_without_camera_comes_in_uncalibrated(made, tmp_path) -> None:
    content = made.yaml()
    del content["camera"]
    made.write_yaml(content)
    summary = import_set(made.path, tmp_path / "a.mcap", calibrate=True)
    assert any("nothing was calibrated" in note for note in summary.notes)


def test_numbers_given_at_import_tell_no_losses(whole_set, tmp_path) -> None:
    import_set(whole_set.path, tmp_path / "a.mcap")
    topics = log_info(read_flight(tmp_path / "a.mcap")).topics
    assert topics["/imu/0"].lost is None
    assert topics["/camera/root/image"].lost == 0
