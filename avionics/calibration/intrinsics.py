"""The lens from pictures of a chessboard."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from avionics.errors import DataSetError

FloatArray = NDArray[np.float64]

PARAMETERS = ("f_x_px", "f_y_px", "c_x_px", "c_y_px", "k1", "k2", "p1", "p2")
LEAST_BOARDS = 4
BAD_BOARD = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Intrinsics:
    """A calibrated lens; pixels are counted from the centre of the first one.

    Attributes
    ----------
    values : dict of str to float
        By the names of ``PARAMETERS``; k3 is zero, chessboards do not show it.
    sigma : dict of str to float
        Formal one-sigmas.
    rms_px : float
        Residual of the corners.
    boards : int
        Pictures used.
    refused : tuple of str
        Pictures that were not, and why.
    """

    values: dict[str, float]
    sigma: dict[str, float]
    rms_px: float
    boards: int
    refused: tuple[str, ...]


def calibrate_lens(
    pictures: Sequence[tuple[str, NDArray[np.uint8]]],
    corners: tuple[int, int],
    square_m: float,
    size_px: tuple[int, int],
) -> Intrinsics:
    """Return the lens that explains pictures of a chessboard.

    Parameters
    ----------
    pictures : sequence of (str, ndarray)
        Name and gray picture, shape (H, W).
    corners : tuple of int
        Inner corners of the board, columns and rows in either order.
    square_m : float
        Side of a square, m.
    size_px : tuple of int
        Width and height of the camera's pictures, px.

    Raises
    ------
    DataSetError
        If fewer than four pictures show the board.
    """
    board = np.zeros((corners[0] * corners[1], 3), np.float32)
    board[:, :2] = np.mgrid[0 : corners[0], 0 : corners[1]].T.reshape(-1, 2) * square_m
    names: list[str] = []
    seen: list[NDArray[np.float32]] = []
    refused: list[str] = []
    for name, picture in pictures:
        if picture.shape[::-1] != size_px:
            refused.append(f"{name}: {picture.shape[1]} x {picture.shape[0]} px, not {size_px}")
            continue
        is_there, found = cv2.findChessboardCornersSB(
            picture, corners, flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
        )
        if is_there:
            names.append(name)
            seen.append(np.asarray(found, dtype=np.float32).reshape(-1, 1, 2))
        else:
            refused.append(f"{name}: no board of {corners[0]} x {corners[1]} corners found")
    if len(seen) < LEAST_BOARDS:
        why = "; ".join(refused[:3])
        msg = f"chessboard: {len(seen)} of {len(pictures)} pictures show the board, {why}"
        raise DataSetError(msg)
    result = _solve(board, seen, size_px)
    worst = result[1] > max(BAD_BOARD * float(np.median(result[1])), 0.3)
    if worst.any() and (~worst).sum() >= LEAST_BOARDS:
        refused += [f"{names[i]}: {result[1][i]:.2f} px off" for i in np.flatnonzero(worst)]
        seen = [found for found, bad in zip(seen, worst, strict=True) if not bad]
        result = _solve(board, seen, size_px)
    rms_px, _, values, sigma = result
    return Intrinsics(
        dict(zip(PARAMETERS, values.tolist(), strict=True)),
        dict(zip(PARAMETERS, sigma.tolist(), strict=True)),
        rms_px,
        len(seen),
        tuple(refused),
    )


def _solve(
    board: NDArray[np.float32], seen: list[NDArray[np.float32]], size_px: tuple[int, int]
) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    rms, matrix, lens, _, _, deviations, _, per_view = cv2.calibrateCameraExtended(
        [board] * len(seen), seen, size_px, np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
    )
    lens = np.ravel(lens)
    values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *lens[:4]])
    apart = np.ravel(per_view).astype(np.float64)
    return float(rms), apart, values.astype(np.float64), np.ravel(deviations)[:8].astype(np.float64)
