"""Measurement update: gate each marker, iterate, adapt the noise, recover from a lock-out."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse import ekf
from avionics.wse.adaptive_noise import AdaptiveNoise, UpdateRules, matched
from avionics.wse.gyro_step import Motion
from avionics.wse.markers import MarkerModel, View
from avionics.wse.state import Estimate, StateLayout

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class MarkerMeasurement:
    """The found markers of one frame.

    Attributes
    ----------
    t_ns : int
        Middle of the exposure on the gyro clock, ns.
    pixel : ndarray, shape (K, 2)
        Raw-image pixels, px.
    sigma : ndarray, shape (K,)
        One-sigma of each coordinate, px.
    found : ndarray of bool, shape (K,)
        Which markers count.
    """

    t_ns: int
    pixel: Array
    sigma: Array
    found: Array


@dataclass(frozen=True, slots=True, eq=False)
class UpdateResult:
    """What an update did.

    Attributes
    ----------
    t_ns : int
        Exposure of the frame, ns.
    estimate : Estimate
        State and covariance after it, at the exposure.
    noise : AdaptiveNoise
        The noises after it.
    used : ndarray of bool, shape (K,)
        Markers that were used.
    found : int
        Usable markers that the frame showed.
    gated : int
        Found markers that were rejected.
    nis : float
        Normalised innovation squared per degree of freedom; NaN if nothing was used.
    reacquired : bool
        Whether this update ended a lock-out.
    locked_out : bool
        Whether this frame began one.
    lost : bool
        Whether the state had become impossible and was restarted.
    """

    t_ns: int
    estimate: Estimate
    noise: AdaptiveNoise
    used: Array
    found: int = 0
    gated: int = 0
    nis: float = float("nan")
    reacquired: bool = False
    locked_out: bool = False
    lost: bool = False


class MarkerUpdate:
    """Corrects the state by the markers of a frame.

    Parameters
    ----------
    model : MarkerModel
        Prediction of the pixels.
    layout : StateLayout
        Where the amplitudes, the unobserved rates and the time offset stand in the state.
    rules : UpdateRules
        Gate and weights.
    prior : ndarray, shape (n,)
        Prior variances of the amplitudes, rad^2.
    row_time : float
        Rolling shutter: time from row to row, s; the frame's time is that of the middle row.
    """

    def __init__(
        self,
        model: MarkerModel,
        layout: StateLayout,
        rules: UpdateRules,
        prior: Array,
        *,
        row_time: float = 0.0,
    ) -> None:
        self._model = model
        self._layout = layout
        self._rules = rules
        self._prior = prior
        self._row_time = row_time
        self._has_unobserved, self._has_offset = layout.has_unobserved, layout.has_offset

    @property
    def needs_motion(self) -> bool:
        """Whether it matters how the amplitudes move at the exposure."""
        return self._has_offset or bool(self._row_time)

    def apply(
        self,
        estimate: Estimate,
        noise: AdaptiveNoise,
        measurement: MarkerMeasurement,
        motion: Motion,
    ) -> UpdateResult:
        """Return estimate and noises after a frame, and what was done.

        Parameters
        ----------
        estimate, noise : Estimate, AdaptiveNoise
            Before.
        measurement : MarkerMeasurement
            The frame.
        motion : Motion
            Of the amplitudes at the exposure.
        """
        t_ns, (x, P) = measurement.t_ns, estimate
        view, H = self._linearise(x, motion)
        usable = measurement.found & view.can_see
        if not usable.any():
            return UpdateResult(t_ns, estimate, noise, usable)
        y = np.where(usable[:, None], measurement.pixel - view.pixel, 0.0)
        variance = np.where(usable, measurement.sigma, 1.0) ** 2
        distance = _distance(y, H @ P @ H.swapaxes(1, 2), variance + noise.pixel_variance)
        inside = usable & (distance <= self._rules.gate**2)
        found, used = int(usable.sum()), int(inside.sum())
        rejected_frames = noise.rejected_frames + 1 if 2 * used < found else 0
        if not noise.is_started or rejected_frames >= self._rules.lockout_frames:
            acquired = self._acquire(estimate, noise, measurement, motion, usable=usable)
            if acquired is not None:
                return acquired
        after = replace(noise, rejected_frames=rejected_frames)
        locked_out = rejected_frames == 1 and found > 1
        nis = float("nan")
        if used:
            if self._rules.adapt:
                after = matched(
                    after,
                    self._rules,
                    y[inside],
                    H[inside],
                    P,
                    variance=variance[inside],
                    prior=self._prior,
                    unobserved=self._layout.unobserved,
                    live=motion.live,
                )
            estimate, nis = self._iterate(
                estimate, after, measurement, motion, used=inside, first=(view, H)
            )
        return UpdateResult(
            t_ns, estimate, after, inside, found, found - used, nis, locked_out=locked_out
        )

    def _linearise(self, x: Array, motion: Motion) -> tuple[View, Array]:
        """View and pixel Jacobian (K, 2, size) at a state."""
        layout = self._layout
        H = np.zeros((self._model.count, 2, layout.size))
        q, rate = x[layout.amplitudes], motion.rate
        if self._has_unobserved:
            rate = rate + x[layout.unobserved]
        late = float(x[layout.offset][0]) if self._has_offset else 0.0
        view = self._model.view(q + late * (rate + 0.5 * late * motion.acceleration))
        rate = rate + late * motion.acceleration
        H[..., layout.amplitudes] = view.pixel_by_q
        speed = view.pixel_by_q @ rate
        if self._has_offset:
            H[..., layout.offset] = speed[..., None]
            if self._has_unobserved:
                # An unobserved rate shows by what it moves until the camera looks.
                H[..., layout.unobserved] = late * view.pixel_by_q
        camera = self._model.camera
        if self._row_time and camera is not None:
            delay = self._row_time * (view.pixel[:, 1] - 0.5 * (camera.height - 1))
            view = replace(view, pixel=view.pixel + speed * delay[:, None])
        return view, H

    def _iterate(
        self,
        start: Estimate,
        noise: AdaptiveNoise,
        measurement: MarkerMeasurement,
        motion: Motion,
        *,
        used: Array,
        first: tuple[View, Array] | None = None,
        passes: int = 6,
    ) -> tuple[Estimate, float]:
        """Gauss-Newton on prior and markers; stops when the pixels no longer move."""
        variance = measurement.sigma[used] ** 2
        if self._rules.adapt:
            variance = variance + noise.pixel_variance
        R = np.diag(np.repeat(variance, 2))
        x, nis = start.x, float("nan")
        for _ in range(passes):
            view, H = first if first is not None else self._linearise(x, motion)
            first = None
            h = H[used].reshape(-1, self._layout.size)
            y = (measurement.pixel - view.pixel)[used].ravel() + h @ (x - start.x)
            dx, P_after, d2 = ekf.update(start.P, y, h, R)
            moved = np.abs(h @ (start.x + dx - x)).max()
            if np.isnan(nis):
                nis = d2 / len(y)
            x = start.x + dx
            if moved < 3.0:
                break
        return Estimate(x, P_after), nis

    def _acquire(
        self,
        estimate: Estimate,
        noise: AdaptiveNoise,
        measurement: MarkerMeasurement,
        motion: Motion,
        *,
        usable: Array,
    ) -> UpdateResult | None:
        """Fit the shape from the prior; None unless most markers agree on one."""
        rules, q = self._rules, self._layout.amplitudes
        wide = estimate.P.copy()
        if noise.is_started:
            wide[q, q] += np.diag(self._prior)
        chosen = usable.copy()
        allowed = AdaptiveNoise(max(noise.pixel_variance, rules.start_noise**2))
        least = max(2, (int(usable.sum()) + 1) // 2)
        if noise.is_started:
            # Two false lights agree on some shape; half of all the markers hardly do.
            least = max(least, min(3, len(usable)), (len(usable) + 1) // 2)
        while chosen.sum() >= least:
            fit, nis = self._iterate(
                Estimate(estimate.x, wide), allowed, measurement, motion, used=chosen, passes=12
            )
            view, _ = self._linearise(fit.x, motion)
            miss = np.where(chosen[:, None], measurement.pixel - view.pixel, 0.0)
            sigma2 = np.where(chosen, measurement.sigma, 1.0) ** 2 + allowed.pixel_variance
            distance = (miss**2).sum(axis=1) / sigma2
            worst = int(np.argmax(distance))
            if distance[worst] <= rules.gate**2 and np.all(view.can_see[chosen]):
                found = int(usable.sum())
                return UpdateResult(
                    measurement.t_ns,
                    fit,
                    replace(noise, rejected_frames=0, is_started=True),
                    chosen,
                    found,
                    found - int(chosen.sum()),
                    nis,
                    reacquired=noise.is_started,
                )
            chosen[worst] = False
        return None


def _distance(y: Array, spread: Array, noise: Array) -> Array:
    """Return y^T (spread + noise I)^-1 y of every marker, shape (K,)."""
    a, b, d = spread[:, 0, 0] + noise, spread[:, 0, 1], spread[:, 1, 1] + noise
    u, v = y[:, 0], y[:, 1]
    distance: Array = (d * u * u - 2.0 * b * u * v + a * v * v) / (a * d - b * b)
    return distance
