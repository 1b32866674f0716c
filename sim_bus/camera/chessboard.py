"""Pictures of a chessboard through the simulated lens, for calibration."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from avionics.config import Camera
from sim_bus.camera.lens import distorted, undistorted_grid

FloatArray = NDArray[np.float64]
INNER_CORNERS, SQUARE_M = (6, 8), 0.03
OVERSAMPLING = 3
DARK, PAPER, WALL = 28.0, 205.0, 70.0


def chessboards(
    camera: Camera, count: int, rng: np.random.Generator
) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures of a board of 6 x 8 inner corners that lies wholly in the image.

    Parameters
    ----------
    camera : Camera
        Lens and size; its pose does not matter.
    count : int
        Number of pictures.
    rng : numpy.random.Generator
        Poses, light and noise.
    """
    fine = camera.model_copy(
        update={
            "width_px": camera.width_px * OVERSAMPLING,
            "height_px": camera.height_px * OVERSAMPLING,
            "f_x_px": camera.f_x_px * OVERSAMPLING,
            "f_y_px": camera.f_y_px * OVERSAMPLING,
            # Pixel centres are integers: the corner of the image is at -0.5.
            "c_x_px": (camera.c_x_px + 0.5) * OVERSAMPLING - 0.5,
            "c_y_px": (camera.c_y_px + 0.5) * OVERSAMPLING - 0.5,
        }
    )
    ray_x, ray_y = undistorted_grid(fine)
    for _ in range(count):
        axes, centre = _pose(camera, rng)
        yield _render(camera, np.stack([ray_x, ray_y]), axes, centre, rng)


def _pose(camera: Camera, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return the board's axes (columns) and centre in camera axes (right, down, forward)."""
    half = 0.5 * SQUARE_M * (np.array(INNER_CORNERS) + 1.6)
    corners = np.array([[a, b, 0.0] for a in (-half[0], half[0]) for b in (-half[1], half[1])])
    size = np.array([camera.width_px, camera.height_px])
    while True:
        turn = rng.uniform([-0.6, -0.6, -np.pi], [0.6, 0.6, np.pi])
        axes = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        depth = rng.uniform(0.27, 0.5)
        aim = rng.uniform(0.15, 0.85, 2) * size
        x = (aim[0] - camera.c_x_px) / camera.f_x_px
        y = (aim[1] - camera.c_y_px) / camera.f_y_px
        centre = depth * np.array([x, y, 1.0])
        seen = corners @ axes.T + centre
        u, v = distorted(camera, seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2])
        pixel = np.stack([u * camera.f_x_px + camera.c_x_px, v * camera.f_y_px + camera.c_y_px], 1)
        if (pixel > 6).all() and (pixel < size - 7).all():
            return axes, centre


def _render(
    camera: Camera,
    rays: FloatArray,
    axes: FloatArray,
    centre: FloatArray,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    (ray_x, ray_y), normal = rays, axes[:, 2]
    depth = (normal @ centre) / (normal[0] * ray_x + normal[1] * ray_y + normal[2])
    points = np.stack([ray_x * depth, ray_y * depth, depth], -1) - centre
    column = points @ axes[:, 0] / SQUARE_M + 0.5 * (INNER_CORNERS[0] + 1)
    row = points @ axes[:, 1] / SQUARE_M + 0.5 * (INNER_CORNERS[1] + 1)
    squares = np.array(INNER_CORNERS) + 1
    on_board = (column >= 0) & (column < squares[0]) & (row >= 0) & (row < squares[1])
    on_paper = (column > -0.8) & (column < squares[0] + 0.8)
    on_paper &= (row > -0.8) & (row < squares[1] + 0.8)
    is_dark = on_board & ((np.floor(column) + np.floor(row)) % 2 == 0)
    fine = np.where(is_dark, DARK, np.where(on_paper, PAPER, WALL))
    shape = (camera.height_px, OVERSAMPLING, camera.width_px, OVERSAMPLING)
    image = fine.reshape(shape).mean(axis=(1, 3))
    image = cv2.GaussianBlur(image, (0, 0), 0.6) * rng.uniform(0.8, 1.1)
    image = image + 1.5 * rng.standard_normal(image.shape)
    return np.asarray(np.clip(np.rint(image), 0, 255), dtype=np.uint8)
