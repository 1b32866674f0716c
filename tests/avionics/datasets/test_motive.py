"""Motive exports: labelled markers in metres, drop-outs and ghosts."""

import numpy as np
import pytest

from avionics.datasets.motive import read_motive
from avionics.errors import DataSetError

HEAD = "Format Version,1.23,Take Name,T,Export Frame Rate,240.0,Length Units,{unit}\n\n"
NAMES = (
    ",Type,Marker,Marker,Marker,Marker,Marker,Marker\n"
    ",Name,A:1,A:1,A:1,Unlabeled 7,Unlabeled 7,Unlabeled 7\n"
)
AXES = (
    ",ID,x,x,x,y,y,y\n,,Position,Position,Position,Position,Position,Position\n"
    "Frame,Time (Seconds),X,Y,Z,X,Y,Z\n"
)


def write(tmp_path, rows, unit="Millimeters", head=HEAD):
    path = tmp_path / "take.csv"
    path.write_text(head.format(unit=unit) + NAMES + AXES + rows)
    return path


def test_positions_are_metres_and_missing_ones_nan(tmp_path) -> None:
    take = read_motive(write(tmp_path, "0,0.0,1,2,3,4,5,6\n1,0.004,,,,1,1,1\n"))
    assert take.rate_hz == 240.0
    assert take.ghosts == 1
    assert np.allclose(take.position_m["A:1"][0], (0.001, 0.002, 0.003))
    assert np.isnan(take.position_m["A:1"][1]).all()


@pytest.mark.parametrize(
    ("rows", "unit", "head", "words"),
    [
        ("0,0.0,1,2,3\n", "Meters", "a,b\n", "expected a Motive export"),
        ("0,0.0,1,2,3\n", "Feet", HEAD, "Feet"),
        ("", "Meters", HEAD, "no frames"),
        ("0,0.0,one,2,3,4,5,6\n", "Meters", HEAD, "frame 1"),
    ],
)
def test_other_files_are_clear_errors(tmp_path, rows, unit, head, words) -> None:
    with pytest.raises(DataSetError, match=words):
        read_motive(write(tmp_path, rows, unit, head))


def test_recorded_wing(shared_data) -> None:
    take = read_motive(shared_data / "real/flexible-wing-mocap/ir_lab_conditions.csv")
    assert len(take.t_s) == 4857
    assert len(take.position_m) == 23
    gone = np.isnan(take.position_m["Rear_Beam:11"][:, 0]).mean()
    assert 0.6 < gone < 0.75
