"""OpenCV's correlation trackers, KCF and CSRT: one per marker, refined to parts of a pixel.

They return whole boxes; the spot inside the box gives the position. A tracker that lost its
marker, or wandered off from the prediction, is started again where the LED tracker finds the
marker.
"""

from collections.abc import Callable
from typing import Any, Literal

import cv2
import numpy as np

from avionics.config import Config
from avionics.errors import AvionicsError
from avionics.records import FloatArray, MarkerPrediction, MarkerTracks
from avionics.tracking.blobs import Image, gray_of, spots_in
from avionics.tracking.led import LedTracker
from avionics.tracking.tracker import tracks_of
from drivers.samples import Frame

MAKERS = {"csrt": "TrackerCSRT_create", "kcf": "TrackerKCF_create"}
ASTRAY_SIGMAS = 5.0
ASTRAY_PX = 6.0


def maker(name: Literal["csrt", "kcf"]) -> Callable[[], Any]:
    """Return the function of OpenCV that makes a tracker.

    Raises
    ------
    AvionicsError
        If this OpenCV does not carry it.
    """
    for module in (cv2, getattr(cv2, "legacy", None)):
        make = getattr(module, MAKERS[name], None)
        if make is not None:
            return make  # type: ignore[no-any-return]
    msg = (
        f"tracker {name}: OpenCV {cv2.__version__} does not carry it; install "
        "opencv-contrib-python-headless and remove every other opencv wheel"
    )
    raise AvionicsError(msg)


class CorrelationTracker:
    """KCF or CSRT on every marker.

    Parameters
    ----------
    config : Config
        Markers, and the side of a tracker's box.
    name : str
        "csrt" or "kcf".
    """

    def __init__(self, config: Config, name: Literal["csrt", "kcf"]) -> None:
        self.name = name
        self._make = maker(name)
        self._led = LedTracker(config)
        self._box_px = config.tracker.box_px
        self._trackers: list[Any] = [None] * len(config.markers)

    def update(self, frame: Frame, prediction: MarkerPrediction) -> MarkerTracks:
        """Return where a frame shows the markers."""
        gray = gray_of(frame.image)
        count = len(self._trackers)
        pixel, sigma = np.full((count, 2), np.nan), np.full(count, np.nan)
        found = np.zeros(count, dtype=np.bool_)
        for k in range(count):
            place = self._follow(k, gray, prediction)
            if place is not None:
                pixel[k], sigma[k], found[k] = place[:2], place[2], True
        lost = [k for k in range(count) if self._trackers[k] is None]
        if lost:
            led = self._led.update(frame, prediction)
            for k in lost:
                if led.found[k]:
                    pixel[k], sigma[k], found[k] = led.pixel[k], led.sigma_px[k], True
                    self._start(k, gray, led.pixel[k])
        return tracks_of(frame, pixel, sigma, found, self.name)

    def _start(self, marker: int, gray: Image, pixel: FloatArray) -> None:
        box = self._box(pixel, gray)
        if box is None:
            return
        tracker = self._make()
        tracker.init(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), box)
        self._trackers[marker] = tracker

    def _box(self, pixel: FloatArray, gray: Image) -> tuple[int, int, int, int] | None:
        side = self._box_px
        left, top = (round(float(c) - (side - 1) / 2) for c in pixel)
        height, width = gray.shape
        if left < 0 or top < 0 or left + side > width or top + side > height:
            return None
        return left, top, side, side

    def _follow(
        self, marker: int, gray: Image, prediction: MarkerPrediction
    ) -> tuple[float, float, float] | None:
        """Return position and sigma of a marker by its tracker; forget a lost tracker."""
        tracker = self._trackers[marker]
        if tracker is None:
            return None
        is_there, box = tracker.update(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR))
        place = self._inside(gray, box) if is_there else None
        if place is None or self._is_astray(place, prediction, marker):
            self._trackers[marker] = None
            return None
        return place

    def _inside(self, gray: Image, box: tuple[float, ...]) -> tuple[float, float, float] | None:
        """Return the spot nearest to the middle of a box, to a part of a pixel."""
        centre = np.array([box[0] + (box[2] - 1) / 2, box[1] + (box[3] - 1) / 2])
        spots = spots_in(gray, centre, self._box_px / 2)
        if len(spots) == 0:
            return None
        nearest = int(np.argmin(np.linalg.norm(spots.pixel - centre, axis=1)))
        return self._led.position(gray, spots, nearest)

    def _is_astray(
        self, place: tuple[float, float, float], prediction: MarkerPrediction, marker: int
    ) -> bool:
        expected = prediction.pixel[marker]
        if not np.isfinite(expected).all():
            return True
        spread = float(np.sqrt(prediction.covariance_px2[marker].trace()))
        distance = float(np.hypot(*(np.array(place[:2]) - expected)))
        return distance > ASTRAY_PX + ASTRAY_SIGMAS * spread
