"""Measurement update: gate each marker, iterate, adapt the pixel noise, come back from lock-out."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse import ekf
from avionics.wse.adaptive_noise import Sighting, Trust, UpdateRules, Verdict
from avionics.wse.markers import MarkerModel, View
from avionics.wse.motion import Motion

Array = NDArray[Any]

# Time between frames over which an unseen rate shows, s.
FRAME_S = 0.033


NO_STATES = slice(0, 0)


class MarkerUpdate:
    """Corrects amplitudes, biases and the camera's time offset by the markers of a frame.

    Parameters
    ----------
    model : MarkerModel
        Prediction of the pixels.
    size : int
        Length of the state.
    rules : UpdateRules
        How measurements are believed.
    prior : ndarray, shape (n,)
        Prior variances of the amplitudes, rad^2.
    offset_index : int or None
        Where the camera's time offset stands in the state.
    unseen : slice
        Where the unseen rates stand in the state.
    row_time : float
        Rolling shutter: time from row to row, s; the frame's time is that of the middle row.
    """

    def __init__(
        self,
        model: MarkerModel,
        size: int,
        rules: UpdateRules,
        prior: Array,
        *,
        offset_index: int | None = None,
        unseen: slice = NO_STATES,
        row_time: float = 0.0,
    ) -> None:
        self._model = model
        self._n = model.basis.count
        self._size = size
        self._rules = rules
        self._prior = prior
        self._offset = offset_index
        self._row_time = row_time
        self._unseen = unseen

    @property
    def needs_motion(self) -> bool:
        """Whether it matters how the amplitudes move at the exposure."""
        return self._offset is not None or bool(self._row_time)

    def apply(
        self, x: Array, P: Array, trust: Trust, sighting: Sighting, motion: Motion
    ) -> tuple[Array, Array, Trust, Verdict]:
        """Return state, covariance and trust after a frame, and what was done.

        Parameters
        ----------
        x, P : ndarray, shapes (size,), (size, size)
            Before.
        trust : Trust
            Before.
        sighting : Sighting
            What the frame shows.
        motion : Motion
            Of the amplitudes at the exposure.
        """
        view, H = self._linearise(x, motion)
        usable = sighting.found & view.can_see
        if not usable.any():
            return x, P, trust, Verdict(usable, 0, 0, float("nan"))
        y = np.where(usable[:, None], sighting.pixel - view.pixel, 0.0)
        spread = H @ P @ H.swapaxes(1, 2)
        noise = np.where(usable, sighting.sigma, 1.0) ** 2
        distance = _distance(y, spread, noise + trust.noise)
        inside = usable & (distance <= self._rules.gate**2)
        found = int(usable.sum())
        lost = trust.rejected_frames + 1 if 2 * int(inside.sum()) < found else 0
        if not trust.is_started or lost >= self._rules.lockout_frames:
            again = self._reacquire(x, P, trust, sighting, motion, usable=usable)
            if again is not None:
                return again
        after = replace(trust, rejected_frames=lost)
        verdict = Verdict(
            inside,
            found,
            found - int(inside.sum()),
            float("nan"),
            locked_out=lost == 1 and found > 1,
        )
        if not inside.any():
            return x, P, after, verdict
        if self._rules.adapt:
            after = self._adapted(after, y[inside], H[inside], P, noise[inside], live=motion.live)
        x, P, nis = self._iterate(x, P, after, sighting, motion, used=inside, first=(view, H))
        return x, P, after, replace(verdict, nis=nis)

    def _linearise(self, x: Array, motion: Motion) -> tuple[View, Array]:
        """View and pixel Jacobian (K, 2, size) at a state."""
        n = self._n
        H = np.zeros((self._model.count, 2, self._size))
        q, rate = x[:n], motion.rate
        if self._unseen.stop > self._unseen.start:
            rate = rate + x[self._unseen]
        late = 0.0 if self._offset is None else float(x[self._offset])
        view = self._model.view(q + late * (rate + 0.5 * late * motion.acceleration))
        rate = rate + late * motion.acceleration
        H[..., :n] = view.pixel_by_q
        speed = view.pixel_by_q @ rate
        if self._offset is not None:
            H[..., self._offset] = speed
            # An unseen rate shows by what it moves until the camera looks.
            H[..., self._unseen] = late * view.pixel_by_q[..., : H[..., self._unseen].shape[-1]]
        camera = self._model.camera
        if self._row_time and camera is not None:
            delay = self._row_time * (view.pixel[:, 1] - 0.5 * (camera.height - 1))
            view = replace(view, pixel=view.pixel + speed * delay[:, None])
        return view, H

    def _variance(self, trust: Trust, sigma: Array) -> Array:
        variance = sigma**2
        return variance + trust.noise if self._rules.adapt else variance

    def _iterate(
        self,
        x0: Array,
        P: Array,
        trust: Trust,
        sighting: Sighting,
        motion: Motion,
        *,
        used: Array,
        first: tuple[View, Array] | None = None,
        passes: int = 6,
    ) -> tuple[Array, Array, float]:
        """Gauss-Newton on prior and markers; stops when the pixels no longer move."""
        variance = np.repeat(self._variance(trust, sighting.sigma[used]), 2)
        R = np.diag(variance)
        x, nis = x0, float("nan")
        for _ in range(passes):
            view, H = first if first is not None else self._linearise(x, motion)
            first = None
            h = H[used].reshape(-1, self._size)
            y = (sighting.pixel - view.pixel)[used].ravel() + h @ (x - x0)
            dx, P_after, d2 = ekf.update(P, y, h, R)
            moved = np.abs(h @ (x0 + dx - x)).max()
            if np.isnan(nis):
                nis = d2 / len(y)
            x = x0 + dx
            if moved < 3.0:
                break
        return x, P_after, nis

    def _adapted(
        self, trust: Trust, y: Array, H: Array, P: Array, noise: Array, *, live: tuple[bool, ...]
    ) -> Trust:
        """Follow two noises: of the pixels, which no shape explains, and of the process.

        The innovation is split into what some amplitudes could explain and the rest. The rest
        shows the pixel noise; the explained part, against its covariance, the process noise.
        """
        rules, n = self._rules, self._n
        y, H = y.ravel(), H.reshape(-1, self._size)
        scaled = H[:, :n] * np.sqrt(self._prior)
        reach, turned = np.linalg.eigh(scaled.T @ scaled)
        strong = reach > 1.0
        U = scaled @ (turned[:, strong] / np.sqrt(reach[strong]))
        shape_part = U.T @ y
        free = len(y) - U.shape[1]
        shown = trust.noise
        if free >= 2:
            rest = (y @ y - shape_part @ shape_part) / free - noise.mean()
            shown = min(max(float(rest), rules.floor**2), 16.0 * max(trust.noise, 1.0))
        frames = trust.frames + 1
        weight = max(1.0 / rules.memory_frames, 1.0 / (frames + 2))
        noise_now = trust.noise + weight * (shown - trust.noise)
        after = replace(trust, noise=noise_now, frames=frames)
        if self._unseen.start == self._unseen.stop or U.shape[1] == 0:
            return after
        scale = trust.scale(live) * self._lesson(trust, shape_part, U.T @ H, P, float(noise.mean()))
        smallest, largest = rules.surprise_range
        return after.with_scale(live, min(max(scale, smallest), largest))

    def _lesson(self, trust: Trust, shape_part: Array, UH: Array, P: Array, noise: float) -> float:
        """Return by what factor an innovation changes the process noise.

        It teaches in proportion to the share of the unseen rates in what it was expected to be:
        nothing about motion is learned while the wing rests.
        """
        rules, directions = self._rules, len(shape_part)
        pixels = directions * (noise + trust.noise)
        S = UH @ P @ UH.T + (noise + trust.noise) * np.eye(directions)
        nis = float(shape_part @ np.linalg.solve(S, shape_part)) / directions
        moves = UH[:, : self._n]
        unseen = FRAME_S**2 * float(((moves @ P[self._unseen, self._unseen]) * moves).sum())
        share = unseen / (unseen + pixels)
        return float(np.exp(rules.surprise_gain * share * (min(nis, 5.0) - 1.0)))

    def _reacquire(
        self, x: Array, P: Array, trust: Trust, sighting: Sighting, motion: Motion, *, usable: Array
    ) -> tuple[Array, Array, Trust, Verdict] | None:
        """Fit the shape anew; None unless most markers agree on one."""
        rules, n = self._rules, self._n
        wide = P.copy()
        if trust.is_started:
            wide[:n, :n] += np.diag(self._prior)
        chosen = usable.copy()
        allowed = Trust(max(trust.noise, rules.start_noise**2))
        least = max(2, (int(usable.sum()) + 1) // 2)
        if trust.is_started:
            # Two false lights agree on some shape; half of all the markers hardly do.
            least = max(least, min(3, len(usable)), (len(usable) + 1) // 2)
        while chosen.sum() >= least:
            fit, P_fit, nis = self._iterate(
                x, wide, allowed, sighting, motion, used=chosen, passes=12
            )
            view, _ = self._linearise(fit, motion)
            miss = np.where(chosen[:, None], sighting.pixel - view.pixel, 0.0)
            sigma2 = np.where(chosen, sighting.sigma, 1.0) ** 2 + allowed.noise
            distance = (miss**2).sum(axis=1) / sigma2
            worst = int(np.argmax(distance))
            if distance[worst] <= rules.gate**2 and np.all(view.can_see[chosen]):
                gated = int(usable.sum() - chosen.sum())
                started = replace(trust, rejected_frames=0, is_started=True)
                verdict = Verdict(
                    chosen, int(usable.sum()), gated, nis, reacquired=trust.is_started
                )
                return fit, P_fit, started, verdict
            chosen[worst] = False
        return None


def _distance(y: Array, spread: Array, noise: Array) -> Array:
    """Return y^T (spread + noise I)^-1 y of every marker, shape (K,)."""
    a, b, d = spread[:, 0, 0] + noise, spread[:, 0, 1], spread[:, 1, 1] + noise
    u, v = y[:, 0], y[:, 1]
    distance: Array = (d * u * u - 2.0 * b * u * v + a * v * v) / (a * d - b * b)
    return distance
