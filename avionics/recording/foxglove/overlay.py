"""What Foxglove draws over a picture: squares where markers were found, circles where expected.

Messages are kept and drawn again; making a new one takes several times as long.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from foxglove_schemas_protobuf.CircleAnnotation_pb2 import CircleAnnotation
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from google.protobuf.timestamp_pb2 import Timestamp

from avionics.kinds import PAPER
from avionics.recording.foxglove.colours import COLOURS
from avionics.recording.schema.messages import NANOSECONDS
from avionics.records import FloatArray, MarkerTracks, WingShapeEstimate

HISTORY_ROWS = 128
"""Rows of each estimate kept to find the one at a late frame's exposure: 1.28 s."""
CORNER_PX = 0.5
"""Foxglove counts from the corner of the first pixel, we from its centre."""
SQUARE_PX = 5.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
NOWHERE = np.empty((0, 2))


class Overlay:
    """Draws the annotations of each frame.

    Parameters
    ----------
    utc_offset_ns : int
        UTC minus steady time, ns.
    """

    def __init__(self, *, utc_offset_ns: int) -> None:
        self._utc_offset_ns = utc_offset_ns
        self._rows: dict[str, deque[tuple[int, FloatArray]]] = {
            kind: deque(maxlen=HISTORY_ROWS) for kind in PAPER
        }
        self._sheets: dict[tuple[int, ...], _Sheet] = {}

    def note(self, row: WingShapeEstimate) -> None:
        """Take an estimate, whose kind is one of ``PAPER``."""
        self._rows[row.kind].append((row.t_ns, row.marker_px))

    def of(self, tracks: MarkerTracks) -> ImageAnnotations:
        """Return the annotations of a frame; they hold until the next call."""
        corners = tracks.pixel[tracks.found][:, None, :] + SQUARE_PX + CORNER_PX
        circles = [
            [at for at in centres if math.isfinite(at[0] + at[1])]
            for kind in PAPER
            for centres in [(self._predicted(kind, tracks.t_ns) + CORNER_PX).tolist()]
        ]
        size = (len(corners), *(len(centres) for centres in circles))
        sheet = self._sheets.get(size)
        if sheet is None:
            sheet = self._sheets[size] = _blank(*size)
        places = [*corners.reshape(-1, 2).tolist(), *(at for some in circles for at in some)]
        for point, (u, v) in zip(sheet.points, places, strict=True):
            point.x, point.y = u, v
        seconds, nanos = divmod(tracks.t_ns + self._utc_offset_ns, NANOSECONDS)
        for stamp in sheet.stamps:
            stamp.seconds, stamp.nanos = seconds, nanos
        return sheet.message

    def _predicted(self, kind: str, t_ns: int) -> FloatArray:
        """Return the estimate's pixels at ``t_ns``, linear between rows; (0, 2) if unknown."""
        before = None
        for row_ns, pixel in reversed(self._rows[kind]):
            if row_ns <= t_ns:
                if before is None or before[0] == row_ns:
                    return pixel
                weight = (t_ns - row_ns) / (before[0] - row_ns)
                return pixel + weight * (before[1] - pixel)
            before = (row_ns, pixel)
        return NOWHERE


class _Sheet(NamedTuple):
    """A message with its parts at hand.

    Attributes
    ----------
    message : ImageAnnotations
        Some squares and circles.
    points : list of Point2
        Four corners of each square, then the centre of each circle.
    stamps : list of Timestamp
        Time of each square and circle.
    """

    message: ImageAnnotations
    points: list[Point2]
    stamps: list[Timestamp]


def _blank(squares: int, *circles: int) -> _Sheet:
    """Return so many squares, and circles of each kind, at no place in particular."""
    square = PointsAnnotation(
        timestamp=Timestamp(),
        type=PointsAnnotation.LINE_LOOP,
        points=[Point2() for _ in SQUARE_PX],
        outline_color=COLOURS["tracks"],
        thickness=1.0,
    )
    message = ImageAnnotations(points=[square] * squares)
    for kind, count in zip(PAPER, circles, strict=True):
        circle = CircleAnnotation(
            timestamp=Timestamp(),
            position=Point2(),
            diameter=8.0,
            thickness=1.0,
            outline_color=COLOURS[kind],
        )
        message.circles.extend([circle] * count)
    corners = [point for drawn in message.points for point in drawn.points]
    return _Sheet(
        message,
        corners + [drawn.position for drawn in message.circles],
        [d.timestamp for d in message.points] + [d.timestamp for d in message.circles],
    )
