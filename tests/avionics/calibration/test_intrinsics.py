"""The lens from chessboards, against the lens that the pictures were made with."""

import cv2
import numpy as np
import pytest

from avionics.calibration.intrinsics import PARAMETERS, calibrate_lens
from avionics.config import Camera
from avionics.errors import DataSetError
from sim_bus.camera.chessboard import INNER_CORNERS, SQUARE_M, chessboards

SIZE = (320, 240)
LENS = Camera(
    width_px=320, height_px=240, f_x_px=255.0, f_y_px=252.0, c_x_px=163.0, c_y_px=117.0,
    k1=-0.18, k2=0.05, p1=4e-4, p2=-6e-4,
)  # fmt: skip


@pytest.fixture(scope="module")
def pictures() -> list[tuple[str, np.ndarray]]:
    found = chessboards(LENS, 12, np.random.default_rng(4))
    return [(f"board{n}.png", picture) for n, picture in enumerate(found)]


def test_lens_of_the_pictures_is_found_within_its_own_sigmas(pictures) -> None:
    lens = calibrate_lens(pictures, INNER_CORNERS, SQUARE_M, SIZE)
    assert lens.boards == 12
    assert lens.refused == ()
    assert lens.rms_px < 0.1
    for name in PARAMETERS:
        error = lens.values[name] - getattr(LENS, name)
        assert abs(error) < 4.0 * lens.sigma[name], (name, error, lens.sigma[name])
    # The sigmas say something: a fraction of a percent of the focal length.
    assert lens.sigma["f_x_px"] < 0.005 * LENS.f_x_px


def test_corners_may_be_given_in_either_order(pictures) -> None:
    columns, rows = INNER_CORNERS
    one = calibrate_lens(pictures[:5], (columns, rows), SQUARE_M, SIZE)
    other = calibrate_lens(pictures[:5], (rows, columns), SQUARE_M, SIZE)
    assert one.boards == other.boards == 5
    for name in PARAMETERS:
        assert other.values[name] == pytest.approx(one.values[name], abs=one.sigma[name])


def test_pictures_that_cannot_be_used_are_named_with_the_reason(pictures) -> None:
    _, first = pictures[0]
    v, u = np.mgrid[0:240, 0:320].astype(np.float32)
    bent = cv2.remap(first, u + 3 * np.sin(v / 20), v, cv2.INTER_LINEAR)  # a board that is not flat
    odd = [
        ("large.png", np.zeros((480, 640), np.uint8)),
        ("wall.png", np.full((240, 320), 90, np.uint8)),
        ("bent.png", bent),
    ]
    lens = calibrate_lens([*pictures, *odd], INNER_CORNERS, SQUARE_M, SIZE)
    assert lens.boards == 12
    large, wall, crooked = lens.refused
    assert large == "large.png: 640 x 480 px, not (320, 240)"
    assert wall == "wall.png: no board of 6 x 8 corners found"
    assert crooked.startswith("bent.png: ")
    assert crooked.endswith(" px off")


def test_three_boards_are_too_few(pictures) -> None:
    wall = ("wall.png", np.full((240, 320), 90, np.uint8))
    with pytest.raises(DataSetError, match=r"3 of 4 pictures show the board, wall\.png"):
        calibrate_lens([*pictures[:3], wall], INNER_CORNERS, SQUARE_M, SIZE)
