"""The camera's pose from markers of known position, against the pose that the pixels came from."""

import numpy as np
import pytest

from avionics.calibration.extrinsics import (
    LENS,
    NOMINAL_LENS_SIGMA,
    POSE,
    MarkerMeasurements,
    calibrate_pose,
    camera_of,
)
from avionics.errors import DataSetError

SIZE = (640, 480)
NOMINAL = {
    "f_x_px": 500.0, "f_y_px": 500.0, "c_x_px": 320.0, "c_y_px": 240.0,
    "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0,
    "x_m": 0.0, "y_m": -0.1, "z_m": -0.15, "roll_deg": 0.0, "tilt_deg": -6.0, "pan_deg": 0.0,
    "time_offset_s": 0.0,
}  # fmt: skip
TRUTH = NOMINAL | {
    "f_x_px": 507.0, "f_y_px": 505.0, "c_x_px": 317.0, "c_y_px": 243.0, "k1": -0.05, "k2": 0.01,
    "x_m": 0.02, "y_m": -0.12, "z_m": -0.13, "roll_deg": 1.5, "tilt_deg": -8.0, "pan_deg": 2.0,
    "time_offset_s": 0.021,
}  # fmt: skip
# What a chessboard leaves.
LENS_SIGMA = {
    "f_x_px": 2.0, "f_y_px": 2.0, "c_x_px": 1.5, "c_y_px": 1.5,
    "k1": 0.01, "k2": 0.02, "p1": 5e-4, "p2": 5e-4,
}  # fmt: skip
START = NOMINAL | {name: TRUTH[name] for name in LENS}
NOISE_PX = 0.2
OFFSET_M = 4e-4


def measurements(seed: int, instants: int = 25) -> tuple[MarkerMeasurements, np.ndarray]:
    """Return six markers on a flapping wing, seen by the true camera, and their errors, m."""
    rng = np.random.default_rng(seed)
    s = np.array([0.6, 0.6, 1.0, 1.0, 1.4, 1.4])
    chord = np.array([0.07, -0.07, 0.06, -0.06, 0.1, -0.1])
    swing = rng.uniform(-0.25, 0.25, (instants, 1))
    rate = rng.uniform(-1.5, 1.5, (instants, 1))
    x, zero = np.broadcast_to(chord, (instants, 6)), np.zeros((instants, 6))
    at = np.stack([x, s * np.cos(swing), s * np.sin(swing)], axis=-1)
    speed = np.stack([zero, -s * np.sin(swing) * rate, s * np.cos(swing) * rate], axis=-1)
    offsets = OFFSET_M * rng.standard_normal((6, 3))
    true = at - offsets + speed * TRUTH["time_offset_s"]
    pixel = camera_of(TRUTH, *SIZE).project(true.reshape(-1, 3))
    pixel = pixel + NOISE_PX * rng.standard_normal(pixel.shape)
    marker = np.tile(np.arange(6), instants)
    made = MarkerMeasurements(marker, at.reshape(-1, 3), speed.reshape(-1, 3), pixel)
    return made, offsets


@pytest.mark.parametrize("seed", [1, 2])
def test_pose_and_clock_are_found_within_their_own_sigmas(seed: int) -> None:
    seen, _ = measurements(seed)
    found = calibrate_pose(seen, START, LENS_SIGMA, SIZE)
    for name in (*LENS, *POSE, "time_offset_s"):
        error = found.values[name] - TRUTH[name]
        assert abs(error) < 4.0 * found.sigma[name], (name, error, found.sigma[name])
    assert found.rms_px == pytest.approx(NOISE_PX, rel=0.15)
    assert found.values["time_offset_s"] == pytest.approx(TRUTH["time_offset_s"], abs=1e-3)
    assert found.sigma["tilt_deg"] < 0.5


def test_lens_of_the_data_sheet_alone_leaves_wider_sigmas() -> None:
    seen, _ = measurements(4, instants=8)
    known = calibrate_pose(seen, START, LENS_SIGMA, SIZE)
    nominal = calibrate_pose(seen, NOMINAL, NOMINAL_LENS_SIGMA, SIZE)
    for name in ("f_x_px", "y_m"):
        assert nominal.sigma[name] > 1.2 * known.sigma[name]
        assert abs(nominal.values[name] - TRUTH[name]) < 4.0 * nominal.sigma[name]


def test_errors_of_the_markers_themselves_are_told_from_the_camera() -> None:
    """One marker sits 2 mm from where motion capture has it; the others where they should."""
    seen, offsets = measurements(5)
    moved = seen.r_in_body_m + np.where(seen.marker[:, None] == 3, [0.0, 0.0, 2e-3], 0.0)
    found = calibrate_pose(
        MarkerMeasurements(seen.marker, moved, seen.speed_m_s, seen.pixel), START, LENS_SIGMA, SIZE
    )
    expected_mm = 1e3 * offsets
    expected_mm[3, 2] += 2.0
    error_mm = found.marker_offset_mm - expected_mm
    # What all have in common is a shift of the camera.
    assert np.abs(error_mm[:, 2] - np.median(error_mm[:, 2])).max() < 0.5
    assert np.argmax(np.abs(found.marker_offset_mm[:, 2])) == 3


def test_wrong_measurements_cost_little() -> None:
    seen, _ = measurements(6)
    clean = calibrate_pose(seen, START, LENS_SIGMA, SIZE)
    pixel = seen.pixel.copy()
    pixel[::25] += 40.0  # one in 25: a reflection taken for the marker
    dirty = calibrate_pose(
        MarkerMeasurements(seen.marker, seen.r_in_body_m, seen.speed_m_s, pixel),
        START,
        LENS_SIGMA,
        SIZE,
    )
    for name in (*POSE, "time_offset_s"):
        change = abs(dirty.values[name] - clean.values[name])
        assert change < 3.0 * clean.sigma[name], (name, change, clean.sigma[name])
    worst = np.abs(dirty.residual_px).max(axis=1)
    assert np.all(worst[::25] > 30.0)
    assert np.median(worst) < 1.0


def test_too_few_measurements_are_refused() -> None:
    seen, _ = measurements(7, instants=1)
    with pytest.raises(DataSetError, match="6 measurements of markers, at least 12 needed"):
        calibrate_pose(seen, START, LENS_SIGMA, SIZE)
