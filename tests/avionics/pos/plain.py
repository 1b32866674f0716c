"""Plain numpy filters: dense matrices, whole-vector updates, nothing shared with the others."""

import numpy as np
from scipy.linalg import expm

from avionics.pos.simulate import Measured, Node


def skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def plain_gs(
    measured: Measured, node: Node, dt: float, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Gs with theta_(k-1) cloned as the specification writes it; linear, integrating.

    Returns u and its covariance after every step.
    """
    law = node.flexure
    F = np.zeros((9, 9))
    F[3:6, 6:9] = np.eye(3)
    F[6:9, 3:6], F[6:9, 6:9] = -np.diag(law.frequency**2), -2 * np.diag(law.damping * law.frequency)
    block = np.zeros((18, 18))
    block[:9, :9], block[9:, 9:] = -F, F.T
    block[6:9, 15:18] = np.diag(law.psd)
    big = expm(block * dt)
    Phi, Q = np.eye(18), np.zeros((18, 18))
    Phi[:9, :9] = big[9:, 9:].T
    Q[:9, :9] = Phi[:9, :9] @ big[:9, 9:]
    Phi[15:, 15:], Phi[15:, 3:6] = 0.0, np.eye(3)
    variance = [np.full(3, np.deg2rad(0.5)), law.sigma, law.rate_sigma]
    variance += [np.full(3, node.master.gyro_bias), np.full(3, node.slave.gyro_bias), law.sigma]
    P, x = np.diag(np.concatenate(variance) ** 2), np.zeros(18)
    R = np.eye(3) * (node.master.gyro_noise**2 + node.slave.gyro_noise**2)
    out, covariance = [], []
    for k in range(1, steps + 1):
        x, P = Phi @ x, Phi @ P @ Phi.T + Q
        turn, I3 = skew(measured.rate_m[k]), np.eye(3)
        H = np.hstack([turn, 0.5 * turn + I3 / dt, np.zeros((3, 3)), -I3, I3, 0.5 * turn - I3 / dt])
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        x = x + K @ (measured.rate_s[k] - measured.rate_m[k] - H @ x)
        rest = np.eye(18) - K @ H
        P = rest @ P @ rest.T + K @ R @ K.T
        out.append(x[:3] + x[3:6])
        covariance.append(P[:3, :3] + P[:3, 3:6] + P[3:6, :3] + P[3:6, 3:6])
    return np.array(out), np.array(covariance)
