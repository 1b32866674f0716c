"""Sub-pixel position of one clipped, blooming spot beside a lit bar.

An LED is drawn over what lies behind it, and a lit bar on one side lifts the flank on that side:
a plain centroid moves towards the bar by a third of a pixel. Here each side has the background
that continues behind it subtracted, and both are clipped at one common height.
"""

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

RING_ANGLES = 24
RING_GAP_PX = 4.0
"""From the spot's edge to where its background is looked at: beyond the halo's steep part."""
LEVEL = 0.5
"""Where the spot begins, between background and clipping height."""
FLOOR_PX = 0.1
"""Centroid error of a well exposed spot: texture, quantisation and compression."""

BAR_SHARE = 0.7
"""Highest bar, between its surroundings and white."""

LINE_SHARE = 0.6
"""Of its height, what a spot may keep on two opposite sides."""

_ANGLES = np.arange(RING_ANGLES) * (2 * np.pi / RING_ANGLES)
_COS, _SIN = np.cos(_ANGLES), np.sin(_ANGLES)
_NEXT = np.roll(np.arange(RING_ANGLES), -1)
_BEFORE = np.roll(np.arange(RING_ANGLES), 1)
_OPPOSITE = np.roll(np.arange(RING_ANGLES), RING_ANGLES // 2)
_PASSES = 2


def refine(
    gray: Image, u: float, v: float, area_px: float, neighbour_px: float = np.inf
) -> tuple[float, float, float]:
    """Return the centroid of a spot and its one-sigma.

    Parameters
    ----------
    gray : ndarray, shape (H, W), uint8
        The picture.
    u, v : float
        Approximate centre, px.
    area_px : float
        Pixels above the level at which the spot was found.
    neighbour_px : float
        Distance of the nearest other spot, px.

    Returns
    -------
    u, v : float
        Centre, px.
    sigma_px : float
        One-sigma of each coordinate, px; infinite where no spot is left above its background.
    """
    radius = float(np.sqrt(area_px / np.pi))
    half = int(np.ceil(radius + 2.0))
    reach = radius + RING_GAP_PX
    # Beside another LED neither side shows the background alone: it is taken as even.
    is_crowded = neighbour_px < 2.0 * reach
    limit = min(radius + 2.0, 0.5 * neighbour_px)
    sigma = np.inf
    for _ in range(_PASSES):
        column, row = round(u), round(v)
        dx, dy, contrast, ground = _bar_direction(gray, u, v, reach)
        if not np.isfinite(ground):
            return u, v, np.inf
        window = _window(gray, column, row, half)
        offset = np.arange(-half, half + 1)
        background: float | FloatArray = ground
        if contrast > 0 and not is_crowded:
            ahead = _window(gray, column + dx, row + dy, half)
            behind = _window(gray, column - dx, row - dy, half)
            side = (offset[None, :] + column - u) * dx + (offset[:, None] + row - v) * dy
            background = np.where(side > 0, ahead, behind)
        over = window - background
        # What the brighter background leaves below clipping is the height both sides share.
        top = float(np.partition(over.ravel(), -4)[-4])
        highest = min(top, _shared_height(window, over))
        if highest <= 8.0:
            return u, v, np.inf
        weight = np.maximum(np.minimum(over, highest) - LEVEL * highest, 0.0)
        # Neighbours in the corner of the window are not this spot.
        far = (offset[None, :] + column - u) ** 2 + (offset[:, None] + row - v) ** 2
        weight[far > limit**2] = 0.0
        total = float(weight.sum())
        if total <= 0.0:
            return u, v, np.inf
        u = column + float(weight.sum(axis=0) @ offset) / total
        v = row + float(weight.sum(axis=1) @ offset) / total
        sigma = float(np.hypot(FLOOR_PX, 0.4 / np.sqrt(area_px) * 8.0 / highest + 0.3 / area_px))
    return u, v, sigma


def _shared_height(window: FloatArray, over: FloatArray) -> float:
    clipped = window >= 254.0
    return float(over[clipped].min()) if clipped.any() else np.inf


def _bar_direction(gray: Image, u: float, v: float, reach: float) -> tuple[int, int, float, float]:
    """Return the shift (px) towards the brightest background, how it stands out, the median.

    The median is infinite where the spot is a piece of a line.
    """
    height, width = gray.shape
    columns = (u + reach * _COS + 0.5).astype(np.intp)
    rows = (v + reach * _SIN + 0.5).astype(np.intp)
    if not (reach < u < width - 1 - reach and reach < v < height - 1 - reach):
        columns = np.minimum(np.maximum(columns, 0), width - 1)
        rows = np.minimum(np.maximum(rows, 0), height - 1)
    ring = gray[rows, columns].astype(np.float64)
    if _is_line(gray, u, v, reach, ring):
        return 0, 0, -1.0, np.inf
    # Another LED beside this one is no background: only a bar of moderate height is.
    middle = _middle(ring)
    ring[ring > middle + BAR_SHARE * (255.0 - middle)] = middle
    smooth = ring + 0.5 * (ring[_NEXT] + ring[_BEFORE])
    best = int(smooth.argmax())
    contrast = 0.5 * (float(smooth[best]) - _middle(smooth))
    shift = reach + 1.0
    return round(shift * _COS[best]), round(shift * _SIN[best]), contrast, middle


def _is_line(gray: Image, u: float, v: float, reach: float, ring: FloatArray) -> bool:
    """Return whether a spot goes on to two opposite sides: a piece of a bar, no LED.

    An LED in a row has neighbours on both sides too, but it is dark in between.
    """
    height, width = gray.shape
    middle = _middle(ring)
    over = ring - middle
    both = np.minimum(over, over[_OPPOSITE])
    k = int(both.argmax())
    peak = float(gray[min(max(round(v), 0), height - 1), min(max(round(u), 0), width - 1)])
    least = LINE_SHARE * (peak - middle)
    if both[k] <= least:
        return False
    along = np.arange(-np.ceil(reach), np.ceil(reach) + 1)
    across = np.array([[-1.0], [0.0], [1.0]])  # the ring's direction is known to half its step
    columns = np.rint(u + along * _COS[k] - across * _SIN[k]).astype(np.intp)
    rows = np.rint(v + along * _SIN[k] + across * _COS[k]).astype(np.intp)
    path = gray[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].max(axis=0)
    return bool(path.min() - middle > least)


def _middle(values: FloatArray) -> float:
    half = len(values) // 2
    return float(np.partition(values, half)[half])


def _window(gray: Image, column: int, row: int, half: int) -> FloatArray:
    height, width = gray.shape
    top, left = row - half, column - half
    bottom, right = row + half + 1, column + half + 1
    if top >= 0 and left >= 0 and bottom <= height and right <= width:
        return gray[top:bottom, left:right].astype(np.float64)
    rows = np.clip(np.arange(top, bottom), 0, height - 1)
    columns = np.clip(np.arange(left, right), 0, width - 1)
    return gray[np.ix_(rows, columns)].astype(np.float64)
