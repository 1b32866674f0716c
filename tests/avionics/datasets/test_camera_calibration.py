"""The camera of a set against the one that took its pictures."""

import json

import pytest

from avionics.datasets.importer import import_set
from avionics.recording import LogReader
from tests.avionics.conftest import make_set

pytestmark = pytest.mark.slow


def test_calibration_finds_the_camera_and_its_clock(tmp_path) -> None:
    made = make_set(tmp_path / "late", seconds=9.0, time_offset_s=-0.02)
    log = tmp_path / "a.mcap"
    summary = import_set(made.path, log, calibrate=True)
    camera = LogReader(log).config.camera
    assert camera.calibrated
    assert camera.tilt_deg == pytest.approx(-14.0, abs=0.3)
    assert camera.f_x_px == pytest.approx(300.0, abs=4.0)
    assert camera.r_in_body_m == pytest.approx((0.03, -0.02, -0.3), abs=0.02)
    assert camera.time_offset_s == pytest.approx(-0.02, abs=5e-4)
    assert summary.calibration.pose.rms_px < 0.2
    stored = json.loads(LogReader(log).attachments["calibration.json"])
    assert stored["pose"]["rms_px"] == summary.calibration.pose.rms_px
    assert any("no chessboard" in note for note in summary.notes)
