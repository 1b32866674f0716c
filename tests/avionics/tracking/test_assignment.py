"""Joint assignment on small hand-made cases."""

import numpy as np

from avionics.tracking.assignment import NONE, assign, best_hypothesis, common_shift

EXPECTED = np.array([[10.0, 10.0], [50.0, 10.0], [30.0, 40.0]])
EYE = np.broadcast_to(np.eye(2), (3, 2, 2))


def test_common_shift_is_the_one_that_most_markers_share() -> None:
    spots = np.array([[13.0, 12.0], [53.1, 11.9], [28.0, 39.0], [33.0, 42.0]])
    shift = common_shift(EXPECTED, spots, np.full(3, 8.0))
    assert np.allclose(shift, (3.0, 2.0), atol=0.15)


def test_common_shift_without_spots_in_reach_is_zero() -> None:
    assert common_shift(EXPECTED, np.array([[200.0, 200.0]]), np.full(3, 8.0)).tolist() == [0, 0]


def test_one_spot_goes_to_one_marker() -> None:
    expected = np.array([[10.0, 10.0], [12.0, 10.0]])
    chosen = assign(expected, np.array([[10.5, 10.0]]), EYE[:2], gate=4.0)
    assert chosen.tolist() == [0, NONE]


def test_gate_and_nan_leave_markers_without_a_spot() -> None:
    expected = np.array([[10.0, 10.0], [np.nan, np.nan], [30.0, 40.0]])
    spots = np.array([[10.0, 15.0], [30.2, 40.0]])
    assert assign(expected, spots, EYE, gate=4.0).tolist() == [NONE, NONE, 1]


def test_forbidden_pairs_are_not_made() -> None:
    penalty = np.zeros((3, 1))
    penalty[0] = np.inf
    chosen = assign(EXPECTED, np.array([[10.0, 10.0]]), EYE, gate=4.0, penalty=penalty)
    assert chosen.tolist() == [NONE, NONE, NONE]


def test_best_hypothesis_explains_most_markers() -> None:
    fan = np.stack([EXPECTED + (0, d) for d in (-20.0, 0.0, 20.0)])
    spots = np.concatenate([EXPECTED + (1.0, 19.0), [[80.0, 80.0]]])
    index, cost = best_hypothesis(fan, spots, np.ones((3, 3), bool), tolerance_px=10.0)
    assert index == 2
    assert cost < 0.1
