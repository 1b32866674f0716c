"""The filter algebra of every method: sparse propagation, Joseph updates, backward smoothing.

All functions are compiled and work in place on preallocated arrays: they run 130 000 times per
estimate. Measurements are processed as scalars; their noises must be independent.
"""

from avionics.pos.compiled import Array, IndexArray, compiled


@compiled
def propagate(P: Array, D: Array, pattern: IndexArray, Q: Array, W: Array) -> None:
    """P := (I + D) P (I + D)^T + Q.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Covariance, changed in place.
    D : ndarray, shape (n, n)
        Transition minus identity.
    pattern : ndarray of int, shape (nnz, 2)
        Where D is not zero.
    Q : ndarray, shape (n, n)
        Noise of the step.
    W : ndarray, shape (n, n)
        Scratch.
    """
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            W[i, j] = P[i, j]
    for e in range(pattern.shape[0]):
        i, j = pattern[e, 0], pattern[e, 1]
        value = D[i, j]
        for c in range(n):
            W[i, c] += value * P[j, c]
    for i in range(n):
        for j in range(n):
            P[i, j] = W[j, i]
    for e in range(pattern.shape[0]):
        i, j = pattern[e, 0], pattern[e, 1]
        value = D[i, j]
        for c in range(n):
            P[i, c] += value * W[c, j]
    for i in range(n):
        for j in range(i + 1):
            mean = 0.5 * (P[i, j] + P[j, i]) + Q[i, j]
            P[i, j] = mean
            P[j, i] = mean


@compiled
def scalar_update(P: Array, dx: Array, h: Array, r: float, y: float, K: Array, g: Array) -> float:
    """Update with one scalar measurement in Joseph form; return the innovation variance.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Covariance, changed in place.
    dx : ndarray, shape (n,)
        Correction so far, changed in place.
    h : ndarray, shape (n,)
        Row of H.
    r : float
        Noise variance.
    y : float
        Innovation, correction so far already taken off.
    K, g : ndarray, shape (n,)
        The gain (result) and scratch.
    """
    n = P.shape[0]
    s = r
    for i in range(n):
        g[i] = 0.0
    for j in range(n):
        if h[j] != 0.0:
            for i in range(n):
                g[i] += h[j] * P[j, i]
    for i in range(n):
        s += h[i] * g[i]
    for i in range(n):
        K[i] = g[i] / s
        dx[i] += K[i] * y
    for i in range(n):
        b = 0.0
        for j in range(n):
            P[i, j] -= K[i] * g[j]
            b += P[i, j] * h[j]
        b -= r * K[i]
        for j in range(n):
            P[i, j] -= b * K[j]
    for i in range(n):
        for j in range(i):
            mean = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = mean
            P[j, i] = mean
    return s


@compiled
def smooth_update(lam: Array, Lam: Array, h: Array, K: Array, s: float, y: float, v: Array) -> None:
    """Step the adjoint backward over one scalar update (modified Bryson-Frazier).

    Parameters
    ----------
    lam, Lam : ndarray, shapes (n,), (n, n)
        Adjoint vector and matrix, changed in place: the smoothed state is x - P lam, its
        covariance P - P Lam P.
    h, K : ndarray, shape (n,)
        Row of H and gain of the update.
    s, y : float
        Innovation variance and innovation of the update.
    v : ndarray, shape (n,)
        Scratch.
    """
    n = lam.shape[0]
    along = 0.0
    for i in range(n):
        along += K[i] * lam[i]
    along += y / s
    for i in range(n):
        lam[i] -= h[i] * along
    c = 1.0 / s
    for i in range(n):
        v[i] = 0.0
        for j in range(n):
            v[i] += Lam[i, j] * K[j]
        c += K[i] * v[i]
    for i in range(n):
        for j in range(n):
            Lam[i, j] += c * h[i] * h[j] - h[i] * v[j] - v[i] * h[j]


@compiled
def smooth_propagate(
    lam: Array, Lam: Array, D: Array, pattern: IndexArray, W: Array, v: Array
) -> None:
    """Step the adjoint backward over one propagation: lam := Phi^T lam, Lam := Phi^T Lam Phi."""
    n = lam.shape[0]
    for i in range(n):
        v[i] = lam[i]
        for j in range(n):
            W[i, j] = Lam[i, j]
    for e in range(pattern.shape[0]):
        i, j = pattern[e, 0], pattern[e, 1]
        value = D[i, j]
        lam[j] += value * v[i]
        for c in range(n):
            W[j, c] += value * Lam[i, c]
    for i in range(n):
        for j in range(n):
            Lam[i, j] = W[j, i]
    for e in range(pattern.shape[0]):
        i, j = pattern[e, 0], pattern[e, 1]
        value = D[i, j]
        for c in range(n):
            Lam[j, c] += value * W[c, i]
    for i in range(n):
        for j in range(i):
            mean = 0.5 * (Lam[i, j] + Lam[j, i])
            Lam[i, j] = mean
            Lam[j, i] = mean
