"""Lights that stand still: learnt after three pictures, forgotten after forty without them."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from avionics.tracking.lights import CERTAIN, FORGET, SAME_PX, StandingLights

NONE = np.empty((0, 2))
LAMP = np.array([100.0, 50.0])


def learnt(*pictures) -> StandingLights:
    lights = StandingLights()
    for spots in pictures:
        lights.learn(np.array(spots, dtype=float).reshape(-1, 2))
    return lights


def test_light_is_certain_after_three_pictures_and_not_before() -> None:
    assert len(learnt(*[[LAMP]] * (CERTAIN - 1)).pixel()) == 0
    assert_allclose(learnt(*[[LAMP]] * CERTAIN).pixel(), [LAMP])


def test_spot_that_moves_is_never_a_light() -> None:
    lights = learnt(*[[LAMP + [1.1 * SAME_PX * n, 0.0]] for n in range(10)])
    assert len(lights.pixel()) == 0


def test_spots_at_a_light_are_told_from_others() -> None:
    lights = learnt(*[[LAMP, LAMP + 30.0]] * CERTAIN)
    spots = np.array([LAMP + 0.9 * SAME_PX / np.sqrt(2), LAMP + 10.0, LAMP + 30.0])
    assert_array_equal(lights.are_at(spots), [True, False, True])
    assert lights.are_at(NONE).shape == (0,)
    assert_array_equal(learnt().are_at(spots), [False] * 3)


def test_light_that_is_gone_is_forgotten() -> None:
    lights = learnt(*[[LAMP]] * CERTAIN, *[[]] * (FORGET - 1))
    assert len(lights.pixel()) == 1
    lights.learn(NONE)
    assert len(lights.pixel()) == 0


def test_light_that_a_marker_hides_for_a_while_is_remembered() -> None:
    hidden = [[]] * (FORGET - 1)
    lights = learnt(*[[LAMP]] * CERTAIN, *hidden, [LAMP], *hidden)
    assert_allclose(lights.pixel(), [LAMP])
