"""The filter algebra against dense matrix formulas and a textbook RTS smoother."""

import numpy as np

from avionics.pos.difference_model import pattern_of
from avionics.pos.kalman import propagate, scalar_update, smooth_propagate, smooth_update
from avionics.pos.smoother import smooth_constant, smooth_varying

N = 7
RNG = np.random.default_rng(11)


def random_covariance(size: int = N) -> np.ndarray:
    root = RNG.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


def sparse_change() -> np.ndarray:
    D = RNG.normal(size=(N, N)) * 0.3
    D[RNG.random((N, N)) < 0.6] = 0.0
    return D


def test_propagate_is_the_dense_formula() -> None:
    P, D, Q = random_covariance(), sparse_change(), 0.1 * random_covariance()
    found, W = P.copy(), np.empty((N, N))
    propagate(found, D, pattern_of(D), Q, W)
    Phi = np.eye(N) + D
    np.testing.assert_allclose(found, Phi @ P @ Phi.T + Q, atol=1e-13)
    np.testing.assert_array_equal(found, found.T)


def test_scalar_update_is_the_dense_formula() -> None:
    P, h, r, y = random_covariance(), RNG.normal(size=N), 0.3, 0.7
    h[2] = 0.0
    found, dx, K, g = P.copy(), np.zeros(N), np.empty(N), np.empty(N)
    s = scalar_update(found, dx, h, r, y, K, g)
    gain = P @ h / (h @ P @ h + r)
    np.testing.assert_allclose(s, h @ P @ h + r, rtol=1e-14)
    np.testing.assert_allclose(K, gain, rtol=1e-13)
    np.testing.assert_allclose(dx, gain * y, rtol=1e-13)
    np.testing.assert_allclose(found, P - np.outer(gain, h @ P), atol=1e-13)


def test_joseph_form_stays_positive_where_the_short_form_does_not() -> None:
    """A measurement 1e-9 times the prior, repeated: no variance may turn negative."""
    P, h = np.diag([1.0, 1.0 + 1e-9]), np.array([1.0, 1.0])
    dx, K, g = np.zeros(2), np.empty(2), np.empty(2)
    for _ in range(2000):
        scalar_update(P, dx, h, 1e-18, 0.0, K, g)
        assert np.linalg.eigvalsh(P).min() > -1e-18


def run_filter(
    D: np.ndarray, Q: np.ndarray, H: np.ndarray, z: np.ndarray, P0: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Filter with the compiled pieces, keeping what the smoother wants."""
    steps, rows = z.shape
    P, x, W = P0.copy(), np.zeros(N), np.empty((N, N))
    xs, Ps = np.zeros((steps + 1, N)), np.zeros((steps + 1, N, N))
    Ps[0] = P
    Hs, Ks, sy = np.empty((steps, rows, N)), np.empty((steps, rows, N)), np.empty((steps, rows, 2))
    K, g = np.empty(N), np.empty(N)
    for k in range(steps):
        x = x + D @ x
        propagate(P, D, pattern_of(D), Q, W)
        dx = np.zeros(N)
        for i in range(rows):
            innovation = z[k, i] - H[k, i] @ (x + dx)
            s = scalar_update(P, dx, H[k, i], 0.2, innovation, K, g)
            Hs[k, i], Ks[k, i], sy[k, i] = H[k, i], K, (s, innovation)
        x = x + dx
        xs[k + 1], Ps[k + 1] = x, P
    return xs, Ps, Hs, Ks, sy


def rts(xs: np.ndarray, Ps: np.ndarray, Phi: np.ndarray, Q: np.ndarray) -> tuple[np.ndarray, ...]:
    """Rauch, Tung, Striebel, as in any textbook."""
    x_s, P_s = xs.copy(), Ps.copy()
    for k in range(len(xs) - 2, -1, -1):
        P_next = Phi @ Ps[k] @ Phi.T + Q
        C = Ps[k] @ Phi.T @ np.linalg.inv(P_next)
        x_s[k] = xs[k] + C @ (x_s[k + 1] - Phi @ xs[k])
        P_s[k] = Ps[k] + C @ (P_s[k + 1] - P_next) @ C.T
    return x_s, P_s


def test_smoothers_equal_the_rts_recursion() -> None:
    steps, rows = 12, 2
    D, Q, P0 = sparse_change(), 0.2 * random_covariance(), random_covariance()
    H, z = RNG.normal(size=(steps, rows, N)), RNG.normal(size=(steps, rows))
    xs, Ps, Hs, Ks, sy = run_filter(D, Q, H, z, P0)
    x_s, P_s = rts(xs, Ps, np.eye(N) + D, Q)
    for kind in ("constant", "varying"):
        angle, covariance = xs[:, :6].copy(), Ps[:, :6, :6].copy()
        P_rows, pattern = Ps[:, :6].copy(), pattern_of(D)
        if kind == "constant":
            smooth_constant(P_rows, Hs, Ks, sy, D, pattern, 1, angle, covariance)
        else:
            dynamics = np.tile(D[pattern[:, 0], pattern[:, 1]], (steps, 1))
            smooth_varying(P_rows, Hs, Ks, sy, dynamics, pattern, 1, 1, angle, covariance)
        np.testing.assert_allclose(angle, x_s[:, :6], atol=1e-10)
        np.testing.assert_allclose(covariance, P_s[:, :6, :6], atol=1e-10)


def test_adjoint_steps_are_the_dense_formulas() -> None:
    lam, Lam, D = RNG.normal(size=N), random_covariance(), sparse_change()
    h, K, s, y = RNG.normal(size=N), RNG.normal(size=N), 1.7, 0.4
    a, A, v, W = lam.copy(), Lam.copy(), np.empty(N), np.empty((N, N))
    smooth_update(a, A, h, K, s, y, v)
    rest = np.eye(N) - np.outer(K, h)
    np.testing.assert_allclose(a, -h * y / s + rest.T @ lam, atol=1e-12)
    np.testing.assert_allclose(A, np.outer(h, h) / s + rest.T @ Lam @ rest, atol=1e-11)
    a, A = lam.copy(), Lam.copy()
    smooth_propagate(a, A, D, pattern_of(D), W, v)
    Phi = np.eye(N) + D
    np.testing.assert_allclose(a, Phi.T @ lam, atol=1e-12)
    np.testing.assert_allclose(A, Phi.T @ Lam @ Phi, atol=1e-12)
