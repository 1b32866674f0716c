"""Flexure as a stochastic oscillator: exact discretisation and exact sampling.

One axis obeys theta'' + 2 zeta w theta' + w^2 theta = eta. The second-order Markov process of
Gong et al. (Eq. 3) is zeta = 1 with w = beta = 2.146 / tau; a lightly damped wing mode is zeta < 1.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from avionics.pos.compiled import Array, compiled

MARKOV_BETA = 2.146  # correlation time tau to natural frequency, Gong et al., Eq. 3


@dataclass(frozen=True, slots=True, eq=False)
class Flexure:
    """Oscillators, one per flexing axis.

    Attributes
    ----------
    frequency : ndarray, shape (J,)
        Natural frequency w, rad/s.
    damping : ndarray, shape (J,)
        zeta.
    sigma : ndarray, shape (J,)
        Stationary one-sigma of the angle, rad.
    """

    frequency: Array
    damping: Array
    sigma: Array

    @property
    def psd(self) -> Array:
        """PSD of eta, rad^2/s^3: 4 zeta w^3 sigma^2, so that E theta^2 = sigma^2."""
        return 4.0 * self.damping * self.frequency**3 * self.sigma**2

    @property
    def rate_sigma(self) -> Array:
        """Stationary one-sigma of theta_dot, rad/s."""
        return self.frequency * self.sigma


def markov_flexure(tau: Array, sigma: Array) -> Flexure:
    """Return the second-order Markov process of correlation times tau, s, and sigmas, rad."""
    return Flexure(frequency=MARKOV_BETA / tau, damping=np.ones_like(tau), sigma=sigma)


def discretise(flexure: Flexure, dt: float) -> tuple[Array, Array]:
    """Return the exact transition and noise of (theta, theta_dot) over a step.

    Parameters
    ----------
    flexure : Flexure
        J axes.
    dt : float
        Step, s.

    Returns
    -------
    Phi, Q_d : ndarray, shape (J, 2, 2)
        Transition; covariance of the driven part (Van Loan).
    """
    count = len(flexure.frequency)
    Phi, Q_d = np.empty((count, 2, 2)), np.empty((count, 2, 2))
    for j in range(count):
        w, zeta = flexure.frequency[j], flexure.damping[j]
        F = np.array([[0.0, 1.0], [-(w**2), -2.0 * zeta * w]])
        block = np.zeros((4, 4))
        block[:2, :2], block[2:, 2:] = -F, F.T
        block[1, 3] = flexure.psd[j]
        exponential = expm(block * dt)
        Phi[j] = exponential[2:, 2:].T
        Q_d[j] = Phi[j] @ exponential[:2, 2:]
        Q_d[j] = 0.5 * (Q_d[j] + Q_d[j].T)
    return Phi, Q_d


def sample_flexure(
    flexure: Flexure, dt: float, steps: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draw angle and rate from the stationary law.

    Parameters
    ----------
    flexure : Flexure
        J axes.
    dt, steps : float, int
        Step, s, and number of steps N.
    rng : numpy.random.Generator
        Source of the draws.

    Returns
    -------
    theta, theta_dot : ndarray, shape (N + 1, J)
        rad, rad/s.
    """
    Phi, Q_d = discretise(flexure, dt)
    factor = np.array([np.linalg.cholesky(q) if q[1, 1] > 0.0 else q for q in Q_d])
    start = rng.standard_normal((2, len(Phi))) * np.stack([flexure.sigma, flexure.rate_sigma])
    noise = np.einsum("jab,kjb->kja", factor, rng.standard_normal((steps, len(Phi), 2)))
    return _run_oscillators(Phi, start, noise)


@compiled
def _run_oscillators(Phi: Array, start: Array, noise: Array) -> tuple[Array, Array]:
    steps, count = noise.shape[0], noise.shape[1]
    theta, theta_dot = np.empty((steps + 1, count)), np.empty((steps + 1, count))
    for j in range(count):
        a, b = start[0, j], start[1, j]
        theta[0, j], theta_dot[0, j] = a, b
        for k in range(steps):
            a, b = (
                Phi[j, 0, 0] * a + Phi[j, 0, 1] * b + noise[k, j, 0],
                Phi[j, 1, 0] * a + Phi[j, 1, 1] * b + noise[k, j, 1],
            )
            theta[k + 1, j], theta_dot[k + 1, j] = a, b
    return theta, theta_dot
