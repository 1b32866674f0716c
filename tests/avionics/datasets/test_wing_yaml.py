import numpy as np
import pytest
import yaml
from numpy.testing import assert_array_equal

from avionics.datasets.wing_yaml import read_wing_yaml
from avionics.errors import DataSetError

CONTENT = {
    "wing": {"span_m": 1.5},
    "pods": [{"id": 0, "s_m": 0.6}],
    "mocap": {
        "markers": [],
        "R_lab_from_body": [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
        "t_lab_m": [1, 2, 3],
    },
    "notes": "kept by whoever recorded it",
}
CAMERA = {"width": 640, "height": 480, "nominal": {"cx": 320, "cy": 240, "r_body_m": [0, 0, 0]}}


def read(tmp_path, **changes: object):
    path = tmp_path / "wing.yaml"
    path.write_text(yaml.safe_dump({**CONTENT, **changes}), encoding="utf-8")
    return read_wing_yaml(path)


def test_what_is_not_given_has_the_values_of_the_chip(tmp_path) -> None:
    described = read(tmp_path)
    assert (described.imu.gyro_lsb_per_dps, described.imu.rate_hz) == (16.0, 100.0)
    assert described.mocap is not None
    assert_array_equal(described.mocap.D_lab_from_body @ [1, 0, 0], [0, 1, 0])
    assert_array_equal(described.mocap.t_lab_m, np.array([1.0, 2.0, 3.0]))


def test_one_focal_length_serves_both_axes(tmp_path) -> None:
    camera = {**CAMERA, "nominal": {**CAMERA["nominal"], "f_px": 600.0, "f_y_px": 610.0}}  # type: ignore[dict-item]
    described = read(tmp_path, camera=camera)
    assert described.camera is not None
    assert described.camera.nominal.focal_px == (600.0, 610.0)
    with pytest.raises(DataSetError, match=r"wing\.yaml: camera\.nominal needs f_px"):
        read(tmp_path, camera=CAMERA)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wing": {"span_m": -1}}, r"key 'wing\.span_m': .*\(found -1\)"),
        ({"pods": []}, "key 'pods'"),
        ({"pods": [{"id": 0, "s_m": "root"}]}, r"key 'pods\.0\.s_m'"),
        ({"wing": {"span_m": float("nan")}}, r"key 'wing\.span_m'"),
    ],
)
def test_wrong_value_is_named_with_its_key(tmp_path, changes, words: str) -> None:
    with pytest.raises(DataSetError, match=words):
        read(tmp_path, **changes)
