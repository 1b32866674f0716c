"""Markers in images: the LED tracker, KCF and CSRT behind one interface."""

import cv2

from avionics.config import Config
from avionics.tracking.correlation import CorrelationTracker
from avionics.tracking.led import LedTracker
from avionics.tracking.tracker import Tracker

__all__ = ["Tracker", "make_tracker"]


def make_tracker(config: Config) -> Tracker:
    """Return the tracker that the configuration names; OpenCV works in one thread from then on.

    Raises
    ------
    AvionicsError
        If this OpenCV does not carry it.
    """
    # Its workers wait in a busy loop between calls, 12,000 yields a second, and windows of some
    # pixels gain nothing from them.
    cv2.setNumThreads(1)
    if config.tracker.name == "led":
        return LedTracker(config)
    return CorrelationTracker(config, config.tracker.name)
