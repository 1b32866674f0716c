"""KCF and CSRT: lost, started again, kept from wandering; ``test_contract`` has the rest."""

import cv2
import numpy as np
import pytest

from avionics.errors import AvionicsError
from avionics.tracking import make_tracker
from avionics.tracking.correlation import maker
from tests.avionics.tracking.conftest import LEDS, Scene, config_for, frame_of, prediction_at

pytestmark = pytest.mark.slow

TRUE = np.array(LEDS)


def test_hidden_marker_is_lost_and_started_again() -> None:
    tracker = make_tracker(config_for(6, "kcf"))
    for index in range(4):
        tracker.update(frame_of(Scene(LEDS), index), prediction_at(TRUE))
    for index in range(4, 10):
        scene = Scene(LEDS, hidden=(2,), seed=index)
        tracks = tracker.update(frame_of(scene, index), prediction_at(TRUE))
        assert not tracks.found[2]
    back = [
        tracker.update(frame_of(Scene(LEDS, seed=i), i), prediction_at(TRUE)).found[2]
        for i in range(10, 15)
    ]
    assert any(back)


def test_wandered_tracker_does_not_take_a_light_far_from_the_prediction() -> None:
    tracker = make_tracker(config_for(6, "kcf"))
    for index in range(4):
        tracker.update(frame_of(Scene(LEDS), index), prediction_at(TRUE))
    # Marker 5 stops for the filter, while its light goes on.
    for index in range(4, 24):
        away = TRUE.copy()
        away[5] += (1.5 * (index - 3), 0.0)
        scene = Scene([tuple(p) for p in away], seed=index)
        tracks = tracker.update(frame_of(scene, index), prediction_at(TRUE, 0.5))
    assert not tracks.found[5]


def test_opencv_without_the_trackers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cv2, "TrackerCSRT_create", raising=False)
    monkeypatch.setattr(cv2, "legacy", None, raising=False)
    with pytest.raises(AvionicsError, match="opencv-contrib-python-headless"):
        maker("csrt")
