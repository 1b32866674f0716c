"""A made data set: complete, in the format, and what it says agrees with what flew."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from avionics.config import Config
from avionics.errors import DataSetError
from sim_bus.camera.chessboard import INNER_CORNERS, SQUARE_M, chessboards
from sim_bus.dataset import Blemishes, write_data_set
from sim_bus.dataset_yaml import LAB_FROM_BODY, LAB_ORIGIN_M
from sim_bus.wing.scenario import parse_scenario

pytestmark = pytest.mark.slow

SECONDS = 4.0


@pytest.fixture(scope="module")
def data_set(config: Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("set")
    sweep = {"kind": "sweep", "at_s": 0.5, "for_s": 60}
    hidden = {"kind": "marker_hidden", "target": "camera", "at_s": 2.0, "for_s": 0.8}
    scenario = parse_scenario(
        {"name": "t", "duration_s": SECONDS, "loads": [sweep], "faults": [hidden]}, origin="t"
    )
    write_data_set(
        folder, config, scenario, nominal=config.camera.model_copy(update={"tilt_deg": -16.0}),
        blemishes=Blemishes(gaps=0, lost={1: (3.0, 3.5)}, chessboards=6), seed=1,
    )  # fmt: skip
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as stream:
        return list(csv.DictReader(stream))


def test_rows_of_every_table(data_set: Path) -> None:
    imu = rows(data_set / "imu.csv")
    assert list(imu[0]) == ["t_ns", "pod", *["gx", "gy", "gz", "ax", "ay", "az", "mx", "my", "mz"]]
    times = [int(r["t_ns"]) for r in imu]
    assert times == sorted(times)
    by_pod = {pod: [int(r["t_ns"]) for r in imu if r["pod"] == pod] for pod in ("0", "1")}
    assert 380 <= len(by_pod["0"]) <= 400
    assert max(np.diff(by_pod["1"])) == pytest.approx(0.5e9, rel=0.1)
    frames = rows(data_set / "frames.csv")
    ages_s = [(int(f["t_arrival_ns"]) - int(f["t_exposure_ns"])) * 1e-9 for f in frames]
    assert min(ages_s) >= 0.034
    assert len(frames) == pytest.approx(SECONDS * 30, abs=4)
    mocap = rows(data_set / "mocap.csv")
    assert len(mocap) == SECONDS * 50


def test_video_has_the_frames_and_shows_the_lights(data_set: Path) -> None:
    video = cv2.VideoCapture(str(data_set / "camera.mkv"))
    truth = rows(data_set / "markers_px.csv")
    count = 0
    while True:
        ok, image = video.read()
        if not ok:
            break
        for mark in truth[6 * count : 6 * count + 6]:
            assert int(mark["frame"]) == count
            u, v = round(float(mark["u"])), round(float(mark["v"]))
            if 5 < v < 475:
                bright = image[v - 2 : v + 3, u - 2 : u + 3, 0].max() > 200
                assert bright == (mark["visible"] == "1")
        count += 1
    video.release()
    assert count == len(rows(data_set / "frames.csv"))
    hidden = [m for m in truth if m["visible"] == "0"]
    assert len(hidden) == pytest.approx(6 * 24, abs=18)


def test_mocap_is_the_truth_in_laboratory_axes(data_set: Path, config: Config) -> None:
    start = rows(data_set / "mocap.csv")[0]
    tip = rows(data_set / "truth_tip.csv")[0]
    truth = np.array([float(tip[c]) for c in ("x_m", "y_m", "z_m")])
    pair = [np.array([float(start[f"m{m}_{axis}"]) for axis in "xyz"]) for m in (4, 5)]
    middle = LAB_FROM_BODY.T @ (np.mean(pair, axis=0) - LAB_ORIGIN_M)
    # Markers 4 and 5 sit 8 mm above the tip; each is off by a millimetre at most.
    assert np.linalg.norm(middle - truth) == pytest.approx(0.008, abs=0.0015)


def test_description_tells_the_nominal_camera(data_set: Path, config: Config) -> None:
    told = yaml.safe_load((data_set / "wing.yaml").read_text())
    assert told["camera"]["nominal"]["tilt_deg"] == -16.0
    assert told["imu"]["gyro_bandwidth_hz"] == config.pods[0].chip.gyro_bandwidth_hz
    assert [m["s"] for m in told["markers"]] == [m.s_m for m in config.markers]
    assert told["camera"]["chessboard"] == {"inner_corners": [6, 8], "square_m": 0.03}


def test_gyro_counts_integrate_to_the_tips_turn(data_set: Path) -> None:
    """16 counts per deg/s: over a rest of half a second only the offset (1 deg/s) is left."""
    imu = [r for r in rows(data_set / "imu.csv") if r["pod"] == "0"]
    early = np.array([float(r["gx"]) for r in imu[5:45]]) / 16
    assert abs(early.mean()) < 1.3
    accel = np.array([[float(r[a]) for a in ("ax", "ay", "az")] for r in imu[5:45]]) / 100
    assert np.linalg.norm(accel.mean(axis=0)) == pytest.approx(9.81, abs=0.9)


def test_chessboards_calibrate_back_to_the_lens(config: Config) -> None:
    camera = config.camera
    grid = np.zeros((48, 3), np.float32)
    grid[:, :2] = np.mgrid[0:6, 0:8].T.reshape(-1, 2) * SQUARE_M
    corners = []
    for image in chessboards(camera, 8, np.random.default_rng(0)):
        found, points = cv2.findChessboardCornersSB(image, INNER_CORNERS)
        assert found
        corners.append(points)
    error, matrix, lens, *_ = cv2.calibrateCamera(
        [grid] * len(corners), corners, (640, 480), None, None, flags=cv2.CALIB_FIX_K3
    )
    assert error < 0.15
    assert matrix[0, 0] == pytest.approx(camera.f_x_px, abs=2.5)
    assert matrix[:2, 2] == pytest.approx([camera.c_x_px, camera.c_y_px], abs=3.0)
    assert lens.ravel()[0] == pytest.approx(camera.k1, abs=0.02)


def test_set_without_a_camera_is_refused(config: Config, tmp_path: Path) -> None:
    blind = config.model_copy(update={"camera": None})
    scenario = parse_scenario({"name": "t", "duration_s": 1.0}, origin="t")
    with pytest.raises(DataSetError, match="needs a camera"):
        write_data_set(tmp_path, blind, scenario, nominal=config.camera)
