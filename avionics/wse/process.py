"""Time update: amplitudes by the midpoint rule, covariance by complex-step Jacobians."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse import ekf
from avionics.wse.gyro_step import GyroStep, stacked
from avionics.wse.jacobian import derivatives, perturbed
from avionics.wse.motion import Motion
from avionics.wse.one_mode import midpoint
from avionics.wse.rates import ModalRates

Array = NDArray[Any]

# Accelerations are rate differences over this time, s.
DIFFERENCE_S = 0.01


def unscaled(live: tuple[bool, ...]) -> float:
    """Return one, whatever pods are ``live``."""
    del live
    return 1.0


@dataclass(frozen=True, slots=True)
class ProcessNoise:
    """Noise densities of the time update.

    Attributes
    ----------
    gyro : float
        Gyro noise, rad/s/sqrt(Hz).
    truncation : float
        Noise of every amplitude for the modes left out, rad/sqrt(s).
    bias_walk : float
        Random walk of the biases, rad/s/sqrt(s).
    unseen_s : float
        Correlation time of the unseen rates, s.
    offset_walk : float
        Random walk of the camera's time offset, s/sqrt(s).
    """

    gyro: float
    truncation: float
    bias_walk: float
    unseen_s: float = 0.1
    offset_walk: float = 0.0


class Process:
    """Propagates the state and its covariance.

    The state is (amplitudes; gyro biases by pod and axis; unseen rates; camera time offset), all
    but the first as wanted. Unseen rates are what the gyros do not tell of the amplitudes'
    rates, for want of pods or of modes: first-order Gauss-Markov, sized by the wing's activity.

    Parameters
    ----------
    rates : ModalRates
        Rates of the amplitudes.
    noise : ProcessNoise
        Densities.
    has_bias, has_unseen, has_offset : bool
        Whether those states are there.
    """

    def __init__(
        self,
        rates: ModalRates,
        noise: ProcessNoise,
        *,
        has_bias: bool,
        has_unseen: bool = False,
        has_offset: bool = False,
    ) -> None:
        self._rates = rates
        self._noise = noise
        n, m = rates.basis.count, rates.pods
        self._n = n
        self.bias = slice(n, n + 3 * m if has_bias else n)
        self.unseen = slice(self.bias.stop, self.bias.stop + (n if has_unseen else 0))
        self.offset = self.unseen.stop if has_offset else None
        self.size = self.unseen.stop + int(has_offset)
        walk = np.zeros(self.size)
        walk[:n] = noise.truncation**2
        walk[self.bias] = noise.bias_walk**2
        if self.offset is not None:
            walk[self.offset] = noise.offset_walk**2
        self._walk = np.diag(walk)
        self._identity = np.eye(self.size)
        self._diagonal = np.arange(n)
        self._no_rates = np.zeros(n)
        self._unseen_diagonal = np.arange(self.unseen.start, self.unseen.stop)
        basis = rates.basis
        self._family_sizes = [basis.bending, basis.twist, basis.inplane]

    def input(self, x: Array, step: GyroStep) -> Array:
        """Return the pods' rates less their estimated biases, shape (..., M, 3)."""
        bias = x[..., self.bias]
        return step.rates - bias.reshape(*bias.shape[:-1], -1, 3) if bias.size else step.rates

    def amplitude_rates(self, x: Array, step: GyroStep) -> Array:
        """Return the rates of the amplitudes that the gyros tell, rad/s, shape (n,)."""
        inverse = self._rates.inverse(step.live)
        return self._rates(x[: self._n], self.input(x, step), inverse, step.body)

    def motion(self, x: Array, now: GyroStep, before: GyroStep) -> Motion:
        """Return rates and accelerations of the amplitudes from the gyros at two instants."""
        rate = self.amplitude_rates(x, now)
        acceleration = (rate - self.amplitude_rates(x, before)) / DIFFERENCE_S
        return Motion(rate, acceleration, now.live)

    def still(self, step: GyroStep) -> Motion:
        """Return no motion, for an update that does not ask for it."""
        return Motion(self._no_rates, self._no_rates, step.live)

    def move(self, x: Array, step: GyroStep) -> tuple[Array, Array]:
        """Return the state after a step and the amplitudes at its middle.

        States (..., size) go with stacked steps.
        """
        n, rates, inverse, dt = self._n, self._rates, self._rates.inverse(step.live), step.dt
        is_plain = x.ndim == 1 and step.body is None and self.size == self.bias.stop
        if inverse.one_mode is not None and is_plain:
            return midpoint(x, step.rates, dt, inverse.one_mode)
        omega = self.input(x, step)
        q = x[..., :n]
        first = rates(q, omega, inverse, step.body)
        moved = x.copy()
        if self.unseen.stop == self.unseen.start:
            middle = q + (0.5 * dt) * first
            moved[..., :n] = q + dt * rates(middle, omega, inverse, step.body)
            return moved, middle
        unseen = x[..., self.unseen]
        middle = q + (0.5 * dt) * (first + unseen)
        reach, fade = self._unseen_factors(dt)
        moved[..., :n] = q + dt * rates(middle, omega, inverse, step.body) + reach * unseen
        moved[..., self.unseen] = fade * unseen
        return moved, middle

    def _unseen_factors(self, dt: Any) -> tuple[Any, Any]:
        """Return what an unseen rate moves its amplitude by, s, and how much of it remains."""
        tau = self._noise.unseen_s
        fade = np.exp(-dt / tau)
        return tau * (1.0 - fade), fade

    def run(
        self,
        x: Array,
        P: Array,
        steps: Sequence[GyroStep],
        scales: Callable[[tuple[bool, ...]], float] = unscaled,
    ) -> tuple[list[Array], list[Array]]:
        """Return states and covariances after each of the steps.

        ``scales`` gives the factor on the variance of the unseen rates by live pods.

        The states run first; all Jacobians of all steps then come from one batched call.
        """
        states, middles = [], []
        for step in steps:
            x, middle = self.move(x, step)
            states.append(x)
            middles.append(middle)
        return states, self.spread(P, x, middles, steps, scales)

    def spread(
        self,
        P: Array,
        x: Array,
        middles: Sequence[Array],
        steps: Sequence[GyroStep],
        scales: Callable[[tuple[bool, ...]], float] = unscaled,
    ) -> list[Array]:
        """Return the covariances after each of the steps: Eqs. 9 to 11.

        Parameters
        ----------
        P : ndarray, shape (size, size)
            Before the first step.
        x : ndarray, shape (size,)
            Any state of the run; its biases hold throughout.
        middles : sequence of ndarray, shape (n,)
            Amplitudes at the middle of each step.
        steps : sequence of GyroStep
            The steps.
        scales : callable
            Factor on the variance of the unseen rates by live pods.
        """
        covariances = []
        start = 0
        while start < len(steps):
            stop = start + 1
            while stop < len(steps) and steps[stop].kind == steps[start].kind:
                stop += 1
            stretch = steps[start:stop]
            jacobians = self._jacobians(x, np.array(middles[start:stop]), stretch)
            for F, Q in zip(
                *self._transitions(stretch, jacobians, scales(stretch[0].live)), strict=True
            ):
                P = ekf.predict(P, F, Q)
                covariances.append(P)
            start = stop
        return covariances

    def _jacobians(self, x: Array, middles: Array, steps: Sequence[GyroStep]) -> Array:
        """Complex-step Jacobians by amplitudes and gyro rates, shape (steps, n, n + 3M)."""
        n, m = self._n, self._rates.pods
        omegas = np.array([self.input(x, step).ravel() for step in steps])
        both = perturbed(np.concatenate([middles, omegas], axis=-1))
        omega = both[..., n:].reshape(*both.shape[:-1], m, 3)
        body = None
        if steps[0].body is not None:
            body = np.array([step.body for step in steps])[:, None]
        inverse = self._rates.inverse(steps[0].live)
        values = self._rates(both[..., :n], omega, inverse, body)
        # Perturbations come first for ``derivatives``, the steps stay second.
        return derivatives(values.swapaxes(0, 1))

    def _transitions(
        self, steps: Sequence[GyroStep], jacobians: Array, scale: float
    ) -> tuple[Array, Array]:
        """F and Q of steps with the same pods: Eqs. 10 and 11, with bias and unmodelled noise."""
        n = self._n
        dt = np.array([step.dt for step in steps])[:, None, None]
        A, G = jacobians[..., :n], jacobians[..., n:]
        F = self._identity + np.zeros((len(steps), 1, 1))
        F[:, :n, :n] += A * dt
        if self.bias.stop > n:
            F[:, :n, self.bias] = -G * dt
        Q = self._walk * dt
        Q[:, :n, :n] += (self._noise.gyro**2 * dt) * (G @ G.swapaxes(1, 2))
        if self.unseen.stop > self.unseen.start:
            reach, fade = self._unseen_factors(dt[:, 0])
            F[:, self._diagonal, self._unseen_diagonal] = reach
            F[:, self._unseen_diagonal, self._unseen_diagonal] = fade
            wanted = self.unseen_covariance(stacked(steps), scale)
            Q[:, self.unseen, self.unseen] += (1.0 - fade[..., None] ** 2) * wanted
        return F, Q

    def unseen_covariance(self, step: GyroStep, scale: Any) -> Array:
        """Return the covariance of the unseen rates in the long run, (rad/s)^2, shape (..., n, n).

        Notes
        -----
        ``LiveInverse.blind`` times the recent activity of each family.
        """
        blind = self._rates.inverse(step.live).blind
        activity = np.asarray(scale)[..., None] * step.regime.activity
        covariance: Array = blind * activity.repeat(self._family_sizes, axis=-1)[..., None, :]
        return covariance

    def drifted(self, P: Array, dt: Any, step: GyroStep, scale: Any) -> Array:
        """Return the covariance ``dt`` later, s, without the Jacobians of the steps between.

        Unseen rates and truncation noise move it; what the gyros' noise and the turning of the
        axes add in a tenth of a second is left out.

        Parameters
        ----------
        P : ndarray, shape (..., size, size)
            Before.
        dt : float or ndarray, shape (...)
            How much later, s.
        step : GyroStep
            For live pods and activity.
        scale : float or ndarray, shape (...)
            Of the unseen rates, in variance.
        """
        n, tau, dt = self._n, self._noise.unseen_s, np.asarray(dt)
        wide = P.copy()
        if self.unseen.stop > self.unseen.start:
            F = self._identity + np.zeros((*dt.shape, 1, 1))
            reach, fade = self._unseen_factors(dt[..., None])
            F[..., self._diagonal, self._unseen_diagonal] = reach
            F[..., self._unseen_diagonal, self._unseen_diagonal] = fade
            wide = F @ P @ F.swapaxes(-1, -2)
            # Integral of the Gauss-Markov rate from a known start.
            moved = tau * (2.0 * dt[..., None] - tau * (3.0 - 4.0 * fade + fade**2))
            wide[..., :n, :n] += moved[..., None] * self.unseen_covariance(step, scale)
        wide[..., self._diagonal, self._diagonal] += self._noise.truncation**2 * dt[..., None]
        return wide
