"""What every tracker that the configuration can name has to do; a new one is tested by its name."""

from typing import get_args

import numpy as np
import pytest

from avionics.config import Tracker
from avionics.tracking import make_tracker
from tests.avionics.tracking.conftest import LEDS, Scene, config_for, frame_of, prediction_at

pytestmark = pytest.mark.slow

TRUE = np.array(LEDS)
NAMES = get_args(Tracker.model_fields["name"].annotation)


@pytest.mark.parametrize("name", NAMES)
def test_moving_leds_are_followed_to_parts_of_a_pixel(name: str) -> None:
    tracker = make_tracker(config_for(6, name))
    for index in range(12):
        true = TRUE + (0.37 * index, -1.3 * index)
        scene = Scene([tuple(p) for p in true], seed=index)
        tracks = tracker.update(frame_of(scene, index), prediction_at(true + 0.8))
        assert tracks.tracker == name
        assert (tracks.t_ns, tracks.camera, tracks.frame_index) == (index, "root", index)
        assert tracks.found.sum() >= 5
        error = np.linalg.norm(tracks.pixel - true, axis=1)[tracks.found]
        assert error.max() < 0.4
        assert (tracks.sigma_px[tracks.found] > 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_dark_picture_shows_no_marker(name: str) -> None:
    tracker = make_tracker(config_for(6, name))
    tracks = tracker.update(frame_of(Scene(LEDS, hidden=range(6))), prediction_at(TRUE))
    assert not tracks.found.any()
    assert np.isnan(tracks.pixel).all()


@pytest.mark.parametrize("name", NAMES)
def test_colour_picture_is_read_like_a_gray_one(name: str) -> None:
    tracker = make_tracker(config_for(6, name))
    tracks = tracker.update(frame_of(Scene(LEDS, colour=True)), prediction_at(TRUE + 0.5))
    assert tracks.found.sum() >= 5
