"""Which spot is which marker: all markers at once, each spot at most once.

The prediction's error is mostly common to the markers, since one wing carries them all; a spot
that fits alone but moves against the others is a false light.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from avionics.records import FloatArray

IntArray = NDArray[np.int64]
NONE = -1
PATTERN_PX = 5.0
"""How far markers may deviate from their common shift: shape error beyond the prediction's."""
TOO_FAR = 1e6


def common_shift(expected: FloatArray, spots: FloatArray, reach_px: FloatArray) -> FloatArray:
    """Return the shift (2,), px, that brings the most markers onto spots.

    Parameters
    ----------
    expected : ndarray, shape (K, 2)
        Predicted pixels; NaN takes no part.
    spots : ndarray, shape (N, 2)
        Spots, px.
    reach_px : ndarray, shape (K,)
        How far each marker may be from its prediction.

    Returns
    -------
    ndarray, shape (2,)
        Zero where no spot is in reach.
    """
    shifts = spots[None, :, :] - expected[:, None, :]
    is_near = np.linalg.norm(shifts, axis=-1) <= reach_px[:, None]
    marker, spot = np.nonzero(is_near)
    if marker.size == 0:
        return np.zeros(2)
    votes = shifts[marker, spot]
    # Every vote is tried as the shift; a marker supports it with its best spot.
    distance = np.linalg.norm(votes[:, None, None, :] - shifts[None], axis=-1)
    distance = np.where(is_near[None], distance, PATTERN_PX)
    best = np.nan_to_num(np.minimum(distance.min(axis=2), PATTERN_PX), nan=PATTERN_PX)
    # Of equal support the smaller shift: the prediction is the better guess.
    cost = best.sum(axis=1) + 1e-3 * np.linalg.norm(votes, axis=1)
    chosen = votes[int(np.argmin(cost))]
    residual = shifts - chosen
    close = is_near & (np.linalg.norm(residual, axis=-1) < PATTERN_PX)
    members = shifts[close]
    shift: FloatArray = np.median(members, axis=0) if len(members) else chosen
    return shift


def assign(
    expected: FloatArray,
    spots: FloatArray,
    spread: FloatArray,
    *,
    gate: float,
    penalty: FloatArray | None = None,
) -> IntArray:
    """Return the spot of every marker, or ``NONE``.

    Parameters
    ----------
    expected : ndarray, shape (K, 2)
        Where each marker should be, px; NaN takes no part.
    spots : ndarray, shape (N, 2)
        Spots, px.
    spread : ndarray, shape (K, 2, 2)
        Covariance of the deviation, px^2.
    gate : float
        Largest Mahalanobis distance.
    penalty : ndarray, shape (K, N), optional
        Added to the squared distance; infinite forbids a pair.
    """
    count = len(expected)
    result = np.full(count, NONE, dtype=np.int64)
    if len(spots) == 0 or count == 0:
        return result
    usable = np.asarray(np.isfinite(expected).all(axis=1))
    difference = spots[None, :, :] - np.where(usable[:, None], expected, 0.0)[:, None, :]
    inverse = np.linalg.inv(np.where(usable[:, None, None], spread, np.eye(2)))
    squared = np.einsum("kni,kij,knj->kn", difference, inverse, difference)
    if penalty is not None:
        squared = squared + penalty
    squared[~usable] = TOO_FAR
    squared[squared > gate**2] = TOO_FAR
    markers, chosen = linear_sum_assignment(squared)
    fits = squared[markers, chosen] < TOO_FAR
    result[markers[fits]] = chosen[fits]
    return result


def best_hypothesis(
    hypotheses: FloatArray, spots: FloatArray, inside: NDArray[np.bool_], *, tolerance_px: float
) -> tuple[int, float]:
    """Return the number of the hypothesis that explains most markers, and its cost.

    Parameters
    ----------
    hypotheses : ndarray, shape (S, K, 2)
        Possible pixels of all markers; NaN where not visible.
    spots : ndarray, shape (N, 2)
        Spots, px.
    inside : ndarray of bool, shape (S, K)
        Whether a hypothesis puts a marker into the image.
    tolerance_px : float
        Distance at which a marker counts as missing.

    Returns
    -------
    index : int
    cost : float
        Mean over the markers inside of min(distance / tolerance, 1)^2.
    """
    distance = np.linalg.norm(hypotheses[:, :, None, :] - spots[None, None], axis=-1)
    nearest = np.nan_to_num(distance.min(axis=2), nan=tolerance_px)
    missed = np.minimum(nearest / tolerance_px, 1.0) ** 2
    seen = inside.sum(axis=1)
    # A hypothesis that hides markers outside the image explains less, not more.
    unexplained = np.where(inside, missed, 0.6).sum(axis=1) / inside.shape[1]
    unexplained[seen < min(2, inside.shape[1])] = np.inf
    index = int(np.argmin(unexplained))
    return index, float(unexplained[index])
