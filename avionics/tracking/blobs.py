"""Bright spots of an image: candidates for markers, to about a third of a pixel.

A spot is what stands out of its surroundings by at least half of its own height. That level lies
above the halo and above a lit bar that joins two LEDs.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from avionics.records import FloatArray

Image = NDArray[np.uint8]
Rows = list[tuple[float, float, float, float]]
Box = tuple[int, int, int, int]

SURROUND_PX = 41
"""Side of the square whose mean is a pixel's surroundings; several times the largest spot."""
MIN_CONTRAST = 30.0
"""Least height of a spot over its surroundings, counts: five times the noise of a dark camera."""
LEVEL = 0.65
"""Where a spot begins, between its surroundings and its peak."""
CORE_LEVEL = 0.9
"""Where the core of a spot begins; clipped LEDs that touch have cores apart."""
FULLNESS = 0.6
"""A round spot fills three quarters of its box, two that touch at a corner hardly half."""
MAX_SIDE_PX = 40
MAX_ELONGATION = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Blobs:
    """Spots of one image.

    Attributes
    ----------
    pixel : ndarray, shape (N, 2)
        Centroids (u, v), px; integers are pixel centres.
    height : ndarray, shape (N,)
        Peak over surroundings, counts.
    area_px : ndarray, shape (N,)
        Pixels above the level.
    """

    pixel: FloatArray
    height: FloatArray
    area_px: FloatArray

    def __len__(self) -> int:
        return len(self.pixel)

    def take(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> "Blobs":
        """Return some of the spots."""
        return Blobs(self.pixel[chosen], self.height[chosen], self.area_px[chosen])


def gray_of(image: Image) -> Image:
    """Return a picture as gray levels, shape (H, W)."""
    if image.ndim == 3:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    return image


def find_blobs(gray: Image, *, min_contrast: float = MIN_CONTRAST) -> Blobs:
    """Return the spots of a whole picture.

    Parameters
    ----------
    gray : ndarray, shape (H, W), uint8
        The picture.
    min_contrast : float
        Least height over the surroundings, counts.
    """
    surroundings = cv2.blur(gray, (SURROUND_PX, SURROUND_PX))
    over = cv2.subtract(gray, surroundings)
    _, mask = cv2.threshold(over, min_contrast, 255, cv2.THRESH_BINARY)
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    rows: Rows = []
    for x, y, width, height, _ in stats[1:].tolist():
        # One pixel more on each side: the level of a faint flank may lie outside the region.
        window = gray[max(0, y - 1) : y + height + 1, max(0, x - 1) : x + width + 1]
        ground = float(surroundings[y + height // 2, x + width // 2])
        corner = (max(0, x - 1), max(0, y - 1))
        _spots(window, corner, min(ground, float(window.min()) + 20.0), min_contrast, rows)
    return _blobs(rows)


def spots_in(
    gray: Image, centre: FloatArray, reach_px: float, *, min_contrast: float = MIN_CONTRAST
) -> Blobs:
    """Return the spots of a square window.

    Parameters
    ----------
    gray : ndarray, shape (H, W), uint8
        The picture.
    centre : ndarray, shape (2,)
        Centre of the window, px.
    reach_px : float
        Half its side, px.
    min_contrast : float
        Least height over the window's background, counts.
    """
    height, width = gray.shape
    x0, y0 = (max(0, int(c - reach_px)) for c in centre)
    x1, y1 = min(width, int(centre[0] + reach_px) + 2), min(height, int(centre[1] + reach_px) + 2)
    window = gray[y0:y1, x0:x1]
    rows: Rows = []
    if window.size:
        _regions(window, (x0, y0), min_contrast, rows)
    return _blobs(rows)


def _regions(window: Image, corner: tuple[int, int], min_contrast: float, rows: Rows) -> None:
    """Add the spots of every bright region of a window."""
    ground = float(np.partition(window.ravel(), window.size // 3)[window.size // 3])
    _, mask = cv2.threshold(window, ground + min_contrast, 255, cv2.THRESH_BINARY)
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    for x, y, w, h, _ in stats[1:].tolist():
        part = window[max(0, y - 1) : y + h + 1, max(0, x - 1) : x + w + 1]
        at = (corner[0] + max(0, x - 1), corner[1] + max(0, y - 1))
        _spots(part, at, ground, min_contrast, rows)


def _spots(
    window: Image, corner: tuple[int, int], ground: float, min_contrast: float, rows: Rows
) -> None:
    """Add the spots of one bright region: it may join several, or be no spot at all."""
    top = float(window.max())
    if top - ground < min_contrast:
        return
    level = ground + LEVEL * (top - ground)
    for labels, label, box in _parts(window, level):
        x, y, w, h = box
        part = window[y : y + h, x : x + w]
        mine = labels[y : y + h, x : x + w] == label
        peak = float(part[mine].max()) - ground
        at = (corner[0] + x, corner[1] + y)
        for weight in _apart(part, mine, level, ground):
            _add(weight, at, peak, rows)


def _parts(window: Image, level: float) -> list[tuple[NDArray[Any], int, Box]]:
    """Return label image, label and box of every connected part above a level."""
    _, mask = cv2.threshold(window, level, 255, cv2.THRESH_BINARY)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    boxes = enumerate(stats[1:].tolist(), start=1)
    return [(labels, label, (x, y, w, h)) for label, (x, y, w, h, _) in boxes]


def _apart(part: Image, mine: NDArray[np.bool_], level: float, ground: float) -> list[FloatArray]:
    """Return the weights of the spots that one part holds: two LEDs may touch at half height.

    Where a higher level leaves several cores, every pixel goes to the core that is nearest.
    """
    whole = np.where(mine, part - level, 0.0)
    height, width = part.shape
    if max(height, width) < 1.6 * min(height, width) and mine.mean() > FULLNESS:
        return [whole]
    high = ground + CORE_LEVEL * (float(part[mine].max()) - ground)
    core = np.where(mine & (part >= high), 255, 0).astype(np.uint8)
    count, _, stats, centres = cv2.connectedComponentsWithStats(core, connectivity=4)
    sizes = stats[1:, cv2.CC_STAT_AREA]
    real = 1 + np.flatnonzero(sizes >= max(3.0, 0.25 * float(sizes.max(initial=0))))
    if count < 3 or len(real) < 2:
        return [whole]
    rows, columns = np.indices(part.shape)
    distance = [np.hypot(columns - centres[c, 0], rows - centres[c, 1]) for c in real]
    nearest = np.argmin(distance, axis=0)
    return [np.where(nearest == i, whole, 0.0) for i in range(len(real))]


def _add(weight: FloatArray, corner: tuple[int, int], peak: float, rows: Rows) -> None:
    above = weight > 0
    area = int(above.sum())
    if area == 0:
        return
    columns, lines = np.flatnonzero(above.any(axis=0)), np.flatnonzero(above.any(axis=1))
    w, h = int(columns[-1] - columns[0]) + 1, int(lines[-1] - lines[0]) + 1
    if max(w, h) > MAX_SIDE_PX or max(w, h) > MAX_ELONGATION * min(w, h) + 1:
        return
    total = float(weight.sum())
    u = float(weight.sum(axis=0) @ np.arange(weight.shape[1])) / total + corner[0]
    v = float(weight.sum(axis=1) @ np.arange(weight.shape[0])) / total + corner[1]
    rows.append((u, v, peak, float(area)))


def _blobs(rows: Rows) -> Blobs:
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    return Blobs(table[:, :2], table[:, 2], table[:, 3])
