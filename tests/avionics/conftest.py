"""A small data set that a test may break: an analytic wing, its LEDs in a short video."""

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from avionics.config import Camera, Marker, Wing
from avionics.config import Config as WingConfig
from avionics.flight.filter_setup import marker_model
from avionics.wse.markers import MarkerModel
from avionics.wse.modes import ModeBasis

EPOCH_NS = 1_700_000_000_000_000_000
SPAN_M = 1.5
PLACES = [(0.6, 0.07, -0.012), (0.6, -0.07, -0.012), (1.2, 0.07, -0.012),
          (1.2, -0.07, -0.012), (1.5, 0.12, -0.008), (1.5, -0.12, -0.008)]  # fmt: skip
TRUE_CAMERA = {
    "f_x_px": 300.0, "f_y_px": 300.0, "c_x_px": 159.5, "c_y_px": 119.5, "tilt_deg": -14.0,
    "r_in_body_m": (0.03, -0.02, -0.3), "width_px": 320, "height_px": 240,
}  # fmt: skip
R_LAB_FROM_BODY = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
T_LAB_M = np.array([0.3, -1.2, 1.4])


def bending_rad(t_s: np.ndarray) -> np.ndarray:
    return 0.1 + 0.25 * np.sin(2 * np.pi * 0.7 * t_s)


@dataclass
class MadeSet:
    """Where a set is, and how it was made."""

    path: Path
    seconds: float
    time_offset_s: float = 0.0
    model: MarkerModel = field(init=False)

    def __post_init__(self) -> None:
        markers = tuple(Marker(id=i, s_m=s, x_m=x, z_m=z) for i, (s, x, z) in enumerate(PLACES))
        config = WingConfig(wing=Wing(span_m=SPAN_M), markers=markers, camera=Camera(**TRUE_CAMERA))
        self.model = marker_model(config, ModeBasis("quarter-sine", SPAN_M, 1, 1, 0))

    def q(self, t_s: np.ndarray) -> np.ndarray:
        return np.stack([bending_rad(t_s), np.zeros_like(t_s)], axis=-1)

    def lines(self, name: str) -> list[str]:
        return (self.path / name).read_text(encoding="utf-8").splitlines()

    def write(self, name: str, lines: list[str]) -> None:
        (self.path / name).write_text("\n".join(lines) + "\n", encoding="utf-8")

    def yaml(self) -> dict:
        return yaml.safe_load((self.path / "wing.yaml").read_text(encoding="utf-8"))

    def write_yaml(self, content: dict) -> None:
        (self.path / "wing.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")


def make_set(path: Path, seconds: float = 3.0, time_offset_s: float = 0.0) -> MadeSet:
    """Write a set whose camera stamps are ``time_offset_s`` early against the other clocks."""
    path.mkdir(exist_ok=True)
    made = MadeSet(path, seconds, time_offset_s)
    rng = np.random.default_rng(4)
    t_s = np.arange(0.002, seconds, 0.01)
    rows = ["t_ns,pod,gx,gy,gz,ax,ay,az,mx,my,mz"]
    for i, t in enumerate(t_s):
        for pod, s in ((0, 0.6), (1, 1.2)):
            rate = np.degrees((bending_rad(t + 5e-4) - bending_rad(t - 5e-4)) / 1e-3)
            p = round(16 * rate * np.sin(np.pi * s / (2 * SPAN_M)) + rng.normal(0, 1))
            t_ns = EPOCH_NS + round(t * 1e9) + 2_000_000 * pod + i % 3
            rows.append(f"{t_ns},{pod},{p},0,0,0,0,-981,100,0,300")
    made.write("imu.csv", rows)
    frame_s = np.arange(0.02, seconds - 0.01, 1 / 30)
    pixels = made.model.pixels(made.q(frame_s + time_offset_s))
    video = cv2.VideoWriter(
        str(path / "camera.avi"), cv2.VideoWriter_fourcc(*"FFV1"), 30.0, (320, 240), isColor=False
    )
    v, u = np.mgrid[:240, :320]
    rows = ["frame,t_exposure_ns,t_arrival_ns"]
    for number, (t, spots) in enumerate(zip(frame_s, pixels, strict=True)):
        image = 25.0 + rng.normal(0, 1.5, v.shape)
        for x, y in spots:
            image += 420 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 1.3**2))
        video.write(np.clip(image, 0, 255).astype(np.uint8))
        t_ns = EPOCH_NS + round(t * 1e9)
        rows.append(f"{number},{t_ns},{t_ns + 45_000_000}")
    video.release()
    made.write("frames.csv", rows)
    mocap_s = np.arange(-0.05, seconds + 0.05, 0.02)
    points = made.model.points(made.q(mocap_s)) @ R_LAB_FROM_BODY.T + T_LAB_M
    heads = [f"m{k}_{a}" for k in range(6) for a in "xyz"]
    rows = ["t_ns," + ",".join(heads)]
    for t, point in zip(mocap_s, points, strict=True):
        cells = (f"{value:.5f}" for value in point.ravel())
        rows.append(f"{EPOCH_NS + round(t * 1e9)}," + ",".join(cells))
    made.write("mocap.csv", rows)
    places = [{"id": i, "s": s, "x": x, "z": z} for i, (s, x, z) in enumerate(PLACES)]
    made.write_yaml({
        "wing": {"span_m": SPAN_M, "psi0_deg": 0.0},
        "pods": [{"id": 0, "s_m": 0.6}, {"id": 1, "s_m": 1.2}],
        "imu": {"rate_hz": 100, "gyro_lsb_per_dps": 16, "gyro_bandwidth_hz": 32.0},
        "markers": places,
        "mocap": {
            "markers": places, "R_lab_from_body": R_LAB_FROM_BODY.tolist(),
            "t_lab_m": T_LAB_M.tolist(),
        },
        "camera": {
            "width": 320, "height": 240, "fps": 30,
            "nominal": {"f_px": 294.0, "cx": 159.5, "cy": 119.5, "tilt_deg": -15.5,
                        "r_body_m": [0.03, -0.02, -0.3]},
            "chessboard": {"inner_corners": [6, 8], "square_m": 0.03},
        },
    })  # fmt: skip
    return made


@pytest.fixture(scope="session")
def whole_set(tmp_path_factory: pytest.TempPathFactory) -> MadeSet:
    return make_set(tmp_path_factory.mktemp("sets") / "whole")


@pytest.fixture
def made(tmp_path: Path, whole_set: MadeSet) -> MadeSet:
    """A copy that a test may break."""
    copy = tmp_path / "set"
    copy.mkdir()
    for file in whole_set.path.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    return MadeSet(copy, whole_set.seconds)
