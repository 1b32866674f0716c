"""Scale factors and register values against the data sheet and a recorded chip."""

import csv

import numpy as np
import pytest

from drivers.bno055 import registers as reg
from drivers.bno055.registers import Mode, gyro_config, gyro_scale_rad_s


def test_fusion_scale_is_a_sixteenth_whatever_the_range() -> None:
    for range_dps in (125, 2000):
        assert gyro_scale_rad_s(Mode.NDOF, range_dps) == pytest.approx(np.radians(0.0625))


def test_raw_scale_is_range_over_32768() -> None:
    assert np.degrees(gyro_scale_rad_s(Mode.AMG, 2000)) == pytest.approx(0.061035, abs=1e-6)
    assert np.degrees(gyro_scale_rad_s(Mode.GYRONLY, 125)) == pytest.approx(0.0038147, abs=1e-7)


@pytest.mark.parametrize(
    ("range_dps", "bandwidth_hz", "value"),
    [(2000, 32, 0x38), (125, 523, 0x04), (500, 116, 0x12), (250, 12, 0x2B)],  # table 4-24
)
def test_gyro_configuration_bits(range_dps, bandwidth_hz, value) -> None:
    assert gyro_config(range_dps, bandwidth_hz) == value


def test_unknown_range_is_refused() -> None:
    with pytest.raises(ValueError, match="gyro range 300 deg/s"):
        gyro_config(300, 32)


def recorded(shared_data):
    path = shared_data / "real" / "bno055-registers" / "bno055_100hz.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is absent")
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns = ("timestamp", "gyro_x", "gyro_y", "gyro_z", "quat_w", "quat_x", "quat_y", "quat_z")
    return np.array([[float(row[c]) for c in columns] for row in rows])


def test_fusion_scale_agrees_with_the_quaternion_of_a_real_chip(shared_data) -> None:
    """Regress the rate of the recorded quaternion on the recorded gyro registers."""
    data = recorded(shared_data)
    fresh = np.flatnonzero(np.any(np.diff(data[:, 1:], axis=0) != 0, axis=1)) + 1
    data = data[fresh]
    t_s = data[:, 0] * 1e-3
    q = data[:, 4:] / np.linalg.norm(data[:, 4:], axis=1, keepdims=True)
    a, b = q[:-2], q[2:]
    w = np.sum(a * b, axis=1)
    v = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    rate = 2 * v * np.sign(w)[:, None] / (t_s[2:] - t_s[:-2])[:, None]
    gyro = data[1:-1, 1:4]
    is_even = (t_s[2:] - t_s[:-2] < 0.025) & (np.abs(rate).max(axis=1) < 4)
    x, y = gyro[is_even], rate[is_even]
    slopes = np.degrees(np.sum(x * y, axis=0) / np.sum(x * x, axis=0))
    assert slopes == pytest.approx(reg.GYRO_FUSION_SCALE_DPS, rel=0.016)
    to_fusion, to_raw = (abs(slopes.mean() - x) for x in (reg.GYRO_FUSION_SCALE_DPS, 2000 / 32768))
    assert to_fusion < 0.3 * to_raw


def test_repeats_of_a_real_chip_stay_below_what_is_called_stale(shared_data) -> None:
    from drivers.repeats import STALE_AFTER

    gyro = recorded(shared_data)[:, 1:4]
    same = np.all(np.diff(gyro, axis=0) == 0, axis=1)
    assert same.mean() == pytest.approx(0.036, abs=0.01)
    longest = max(len(run) for run in "".join("x" if s else " " for s in same).split())
    assert longest < STALE_AFTER
