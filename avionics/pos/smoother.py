"""Fixed-interval smoothing of every filter's record (modified Bryson-Frazier).

It gives what the Rauch-Tung-Striebel recursion gives, without inverting a covariance and without
keeping more than the rows of it that are wanted.
"""

import numpy as np

from avionics.pos.compiled import Array, IndexArray, compiled
from avionics.pos.kalman import smooth_propagate, smooth_update


@compiled
def smooth_constant(
    P_rows: Array,
    H: Array,
    K: Array,
    sy: Array,
    D: Array,
    pattern: IndexArray,
    stride: int,
    angle: Array,
    covariance: Array,
) -> None:
    """Smooth angles and covariances of a filter whose transition is constant, in place.

    Parameters
    ----------
    P_rows : ndarray, shape (K, 6, n)
        Rows (rho, theta) of the filter's covariance, at the outputs.
    H, K : ndarray, shape (N, m, n)
        Measurement rows and gains by step.
    sy : ndarray, shape (N, m, 2)
        Innovation variances and innovations by step.
    D, pattern : ndarray, shapes (n, n), (nnz, 2)
        Transition minus identity and where it is not zero.
    stride : int
        Steps between outputs.
    angle, covariance : ndarray, shapes (K, 6), (K, 6, 6)
        The filter's on entry, the smoother's on return.
    """
    n = D.shape[0]
    lam, Lam, v, W = np.zeros(n), np.zeros((n, n)), np.empty(n), np.empty((n, n))
    for k in range(H.shape[0], -1, -1):
        if k % stride == 0:
            apply_adjoint(
                P_rows[k // stride], lam, Lam, angle[k // stride], covariance[k // stride]
            )
        if k == 0:
            break
        for row in range(H.shape[1] - 1, -1, -1):
            smooth_update(
                lam, Lam, H[k - 1, row], K[k - 1, row], sy[k - 1, row, 0], sy[k - 1, row, 1], v
            )
        smooth_propagate(lam, Lam, D, pattern, W, v)


@compiled
def smooth_varying(
    P_rows: Array,
    H: Array,
    K: Array,
    sy: Array,
    dynamics: Array,
    pattern: IndexArray,
    every: int,
    stride: int,
    angle: Array,
    covariance: Array,
) -> None:
    """Smooth as ``smooth_constant`` does, with a transition of its own for every step.

    Parameters
    ----------
    P_rows, H, K, sy, pattern, stride, angle, covariance : ndarray
        As there; H, K and sy by update.
    dynamics : ndarray, shape (N, nnz)
        Elements of the transition minus identity, by step, in the order of the pattern.
    every : int
        Steps between updates.
    """
    n = P_rows.shape[2]
    D = np.zeros((n, n))
    lam, Lam, v, W = np.zeros(n), np.zeros((n, n)), np.empty(n), np.empty((n, n))
    for k in range(dynamics.shape[0], -1, -1):
        if k % stride == 0:
            out = k // stride
            apply_adjoint(P_rows[out], lam, Lam, angle[out], covariance[out])
        if k == 0:
            break
        if k % every == 0:
            kept = k // every - 1
            for row in range(H.shape[1] - 1, -1, -1):
                s, y = sy[kept, row, 0], sy[kept, row, 1]
                smooth_update(lam, Lam, H[kept, row], K[kept, row], s, y, v)
        for e in range(pattern.shape[0]):
            D[pattern[e, 0], pattern[e, 1]] = dynamics[k - 1, e]
        smooth_propagate(lam, Lam, D, pattern, W, v)


@compiled
def apply_adjoint(P_rows: Array, lam: Array, Lam: Array, angle: Array, covariance: Array) -> None:
    """Turn the filter's (rho, theta) and covariance into the smoother's, in place.

    Parameters
    ----------
    P_rows : ndarray, shape (6, n)
        Their rows of the filter's covariance.
    lam, Lam : ndarray, shapes (n,), (n, n)
        The adjoint.
    angle, covariance : ndarray, shapes (6,), (6, 6)
        Changed in place.
    """
    across = P_rows @ Lam
    angle -= P_rows @ lam
    covariance -= across @ P_rows.T
