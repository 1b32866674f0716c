"""Time update: amplitudes by the midpoint rule, covariance by complex-step Jacobians."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse import ekf
from avionics.wse.gyro_step import GyroStep, Motion, stacked
from avionics.wse.jacobian import derivatives, perturbed
from avionics.wse.one_mode import midpoint
from avionics.wse.rates import ModalRates
from avionics.wse.state import StateLayout

Array = NDArray[Any]

# Accelerations are rate differences over this time, s.
DIFFERENCE_S = 0.01
# Correlation time of the unobserved modal rates, s: motion beyond the pods stays alike so long.
UNOBSERVED_S = 0.1


def unscaled(live: tuple[bool, ...]) -> float:
    """Return one, whatever pods are ``live``."""
    del live
    return 1.0


class Process:
    """Propagates the state and its covariance.

    Unobserved rates are the part of the amplitudes' rates that the gyros leave undetermined, for
    want of pods or of modes: first-order Gauss-Markov, sized by the wing's activity.

    Parameters
    ----------
    rates : ModalRates
        Rates of the amplitudes.
    layout : StateLayout
        What the state holds, and the random walk of each part.
    gyro_noise : float
        Noise density of the gyros, rad/s/sqrt(Hz).
    """

    def __init__(self, rates: ModalRates, layout: StateLayout, gyro_noise: float) -> None:
        self.rates = rates
        self.layout = layout
        self._gyro_variance = gyro_noise**2
        n = rates.basis.count
        self._walk = np.diag(layout.walk)
        self._identity = np.eye(layout.size)
        self._no_rates = np.zeros(n)
        self._diagonal = np.arange(n)
        self._unobserved_diagonal = np.arange(layout.unobserved.start, layout.unobserved.stop)
        basis = rates.basis
        self._family_sizes = [basis.bending, basis.twist, basis.inplane]
        self._has_bias, self._has_unobserved = layout.has_bias, layout.has_unobserved
        self._is_amplitudes_and_biases = layout.size == layout.bias.stop

    def input(self, x: Array, step: GyroStep) -> Array:
        """Return the pods' rates less their estimated biases, shape (..., M, 3)."""
        if not self._has_bias:
            return step.rates
        bias = x[..., self.layout.bias]
        return step.rates - bias.reshape(*bias.shape[:-1], -1, 3)

    def amplitude_rates(self, x: Array, step: GyroStep) -> Array:
        """Return the rates of the amplitudes that the gyros measure, rad/s, shape (n,)."""
        inverse = self.rates.inverse(step.live)
        return self.rates(x[self.layout.amplitudes], self.input(x, step), inverse, step.body)

    def motion(self, x: Array, now: GyroStep, before: GyroStep) -> Motion:
        """Return rates and accelerations of the amplitudes from the gyros at two instants."""
        rate = self.amplitude_rates(x, now)
        acceleration = (rate - self.amplitude_rates(x, before)) / DIFFERENCE_S
        return Motion(rate, acceleration, now.live)

    def still(self, step: GyroStep) -> Motion:
        """Return no motion, for an update that does not depend on it."""
        return Motion(self._no_rates, self._no_rates, step.live)

    def move(self, x: Array, step: GyroStep) -> tuple[Array, Array]:
        """Return the state after a step and the amplitudes at its middle.

        States (..., size) go with stacked steps.
        """
        rates, inverse, dt = self.rates, self.rates.inverse(step.live), step.dt
        is_plain = x.ndim == 1 and step.body is None and self._is_amplitudes_and_biases
        if inverse.one_mode is not None and is_plain:
            return midpoint(x, step.rates, dt, inverse.one_mode)
        amplitudes = self.layout.amplitudes
        omega = self.input(x, step)
        q = x[..., amplitudes]
        first = rates(q, omega, inverse, step.body)
        moved = x.copy()
        if not self._has_unobserved:
            middle = q + (0.5 * dt) * first
            moved[..., amplitudes] = q + dt * rates(middle, omega, inverse, step.body)
            return moved, middle
        unobserved = x[..., self.layout.unobserved]
        middle = q + (0.5 * dt) * (first + unobserved)
        reach, fade = _gauss_markov(dt)
        moved[..., amplitudes] = (
            q + dt * rates(middle, omega, inverse, step.body) + reach * unobserved
        )
        moved[..., self.layout.unobserved] = fade * unobserved
        return moved, middle

    def run(
        self,
        x: Array,
        P: Array,
        steps: Sequence[GyroStep],
        scales: Callable[[tuple[bool, ...]], float] = unscaled,
    ) -> tuple[list[Array], list[Array]]:
        """Return states and covariances after each of the steps.

        The states run first; all Jacobians of all steps then come from one batched call.
        ``scales`` is that of ``spread``.
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
        """Return the covariances after each of the steps: Eqs. 9 to 11 of Srikanth et al.

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
            Process-noise scale, on the variance of the unobserved rates, by live pods.
        """
        covariances = []
        start = 0
        while start < len(steps):
            stop = start + 1
            while stop < len(steps) and steps[stop].kind == steps[start].kind:
                stop += 1
            alike = steps[start:stop]
            jacobians = self._jacobians(x, np.array(middles[start:stop]), alike)
            scale = scales(alike[0].live)
            for F, Q in zip(*self._transitions(alike, jacobians, scale), strict=True):
                P = ekf.predict(P, F, Q)
                covariances.append(P)
            start = stop
        return covariances

    def _jacobians(self, x: Array, middles: Array, steps: Sequence[GyroStep]) -> Array:
        """Complex-step Jacobians by amplitudes and gyro rates, shape (steps, n, n + 3M)."""
        n, m = self.rates.basis.count, self.rates.pods
        omegas = np.array([self.input(x, step).ravel() for step in steps])
        both = perturbed(np.concatenate([middles, omegas], axis=-1))
        omega = both[..., n:].reshape(*both.shape[:-1], m, 3)
        body = None
        if steps[0].body is not None:
            body = np.array([step.body for step in steps])[:, None]
        inverse = self.rates.inverse(steps[0].live)
        values = self.rates(both[..., :n], omega, inverse, body)
        # Perturbations come first for ``derivatives``, the steps stay second.
        return derivatives(values.swapaxes(0, 1))

    def _transitions(
        self, steps: Sequence[GyroStep], jacobians: Array, scale: float
    ) -> tuple[Array, Array]:
        """F and Q of steps with the same pods: Eqs. 10 and 11, with bias and unmodelled noise."""
        n, q, unobserved = self.rates.basis.count, self.layout.amplitudes, self.layout.unobserved
        dt = np.array([step.dt for step in steps])[:, None, None]
        A, G = jacobians[..., :n], jacobians[..., n:]
        F = self._identity + np.zeros((len(steps), 1, 1))
        F[:, q, q] += A * dt
        if self._has_bias:
            F[:, q, self.layout.bias] = -G * dt
        Q = self._walk * dt
        Q[:, q, q] += (self._gyro_variance * dt) * (G @ G.swapaxes(1, 2))
        if self._has_unobserved:
            reach, fade = _gauss_markov(dt[:, 0])
            F[:, self._diagonal, self._unobserved_diagonal] = reach
            F[:, self._unobserved_diagonal, self._unobserved_diagonal] = fade
            stationary = self.unobserved_covariance(stacked(steps), scale)
            Q[:, unobserved, unobserved] += (1.0 - fade[..., None] ** 2) * stationary
        return F, Q

    def unobserved_covariance(self, step: GyroStep, scale: Any) -> Array:
        """Return the stationary covariance of the unobserved rates, (rad/s)^2, shape (..., n, n).

        Notes
        -----
        ``LiveInverse.unobserved`` times the recent activity of each family.
        """
        unobserved = self.rates.inverse(step.live).unobserved
        activity = np.asarray(scale)[..., None] * step.regime.activity
        by_amplitude = activity.repeat(self._family_sizes, axis=-1)
        covariance: Array = unobserved * by_amplitude[..., None, :]
        return covariance

    def drifted(self, P: Array, dt: Any, step: GyroStep, scale: Any) -> Array:
        """Return the covariance ``dt`` later, s, without the Jacobians of the steps between.

        Unobserved rates and truncation noise move it; what the gyros' noise and the turning of the
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
            Process-noise scale.
        """
        q, dt = self.layout.amplitudes, np.asarray(dt)
        wide = P.copy()
        if self._has_unobserved:
            F = self._identity + np.zeros((*dt.shape, 1, 1))
            reach, fade = _gauss_markov(dt[..., None])
            F[..., self._diagonal, self._unobserved_diagonal] = reach
            F[..., self._unobserved_diagonal, self._unobserved_diagonal] = fade
            wide = F @ P @ F.swapaxes(-1, -2)
            # Integral of the Gauss-Markov rate from a known start.
            tau = UNOBSERVED_S
            moved = tau * (2.0 * dt[..., None] - tau * (3.0 - 4.0 * fade + fade**2))
            wide[..., q, q] += moved[..., None] * self.unobserved_covariance(step, scale)
        wide[..., self._diagonal, self._diagonal] += self.layout.walk[q] * dt[..., None]
        return wide

    def widen(self, P: Array, step: GyroStep, turn_error: Array) -> Array:
        """Add to ``P``, in place, the error of the turns guessed ahead of the gyros; return it.

        Parameters
        ----------
        P : ndarray, shape (..., size, size)
            Covariance at the end of the step.
        step : GyroStep
            The step ahead of the gyros.
        turn_error : ndarray, shape (..., M, 3)
            Mean square error of such turns so far, rad^2.
        """
        inverse = self.rates.inverse(step.live)
        families = (inverse.phi, inverse.theta, inverse.psi)
        added = [turn_error[..., axis] @ family**2 for axis, family in enumerate(families)]
        P[..., self._diagonal, self._diagonal] += np.concatenate(added, axis=-1)
        return P


def _gauss_markov(dt: Any) -> tuple[Any, Any]:
    """Return by how much an unobserved rate moves its amplitude in a step, s, and what remains."""
    fade = np.exp(-dt / UNOBSERVED_S)
    return UNOBSERVED_S * (1.0 - fade), fade
