"""The filter's algebra against the textbook and, bit for bit, against filterpy."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from numpy.testing import assert_allclose, assert_array_equal

from avionics.wse import ekf


def test_eq16_joseph_update_against_the_textbook_form() -> None:
    rng = np.random.default_rng(5)
    root = rng.normal(size=(4, 4))
    P, H, R = root @ root.T, rng.normal(size=(2, 4)), np.diag([0.3, 0.5])
    y = np.array([0.7, -0.2])
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    dx, after, nis = ekf.update(P, y, H, R)
    assert_allclose(dx, K @ y, atol=1e-12)
    assert_allclose(after, (np.eye(4) - K @ H) @ P, atol=1e-12)
    assert_array_equal(after, after.T)
    assert nis == pytest.approx(y @ np.linalg.inv(S) @ y)


def test_eq11_prediction_is_symmetric_and_spreads_by_the_model() -> None:
    rng = np.random.default_rng(6)
    root = rng.normal(size=(3, 3))
    P, F, Q = root @ root.T, rng.normal(size=(3, 3)), np.diag([0.1, 0.2, 0.3])
    expected = [
        [sum(F[i, k] * P[k, m] * F[j, m] for k in range(3) for m in range(3)) for j in range(3)]
        for i in range(3)
    ]
    predicted = ekf.predict(P, F, Q)
    assert_allclose(predicted, expected + Q, rtol=1e-12)
    assert_array_equal(predicted, predicted.T)


@pytest.mark.parametrize("states", [4, 9, 21, 40])
@pytest.mark.parametrize("markers", [1, 3, 6])
def test_filterpy_gives_the_same_bits(states: int, markers: int) -> None:
    """GIVEN filterpy's filter WHEN it does our step on an error of zero THEN nothing differs."""
    rng = np.random.default_rng(100 * states + markers)
    theirs = ExtendedKalmanFilter(dim_x=states, dim_z=2 * markers)
    zero, P = np.zeros(states), np.eye(states)
    for _ in range(20):
        F = np.eye(states) + 0.1 * rng.normal(size=(states, states))
        Q = np.diag(rng.uniform(0.01, 0.1, states))
        theirs.x, theirs.P, theirs.F, theirs.Q = zero, P, F, Q
        theirs.predict()
        P = ekf.predict(P, F, Q)
        assert_array_equal(P, 0.5 * (theirs.P + theirs.P.T))

        H = rng.normal(size=(2 * markers, states))
        R = np.diag(rng.uniform(0.1, 2.0, 2 * markers))
        y = rng.normal(size=2 * markers)
        theirs.x, theirs.P = zero, P
        theirs.update(y, lambda _, H=H: H, lambda _, y=y: np.zeros_like(y), R=R)
        dx, P, nis = ekf.update(P, y, H, R)
        assert_array_equal(dx, theirs.x)
        assert_array_equal(P, 0.5 * (theirs.P + theirs.P.T))
        assert nis == float(theirs.y @ theirs.SI @ theirs.y)
