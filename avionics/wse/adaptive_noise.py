"""Adaptive noise: pixel noise and process-noise scale that follow the innovations.

Covariance matching: noise is what makes the innovations as large as they are expected to be.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

# Motion beyond pods and modes is a fraction of what mode shapes of equal static weight suggest.
START_SCALE = 0.1
# While a pod is silent the shapes themselves are unobserved.
START_SCALE_PARTIAL = 1.0


@dataclass(frozen=True, slots=True)
class UpdateRules:
    """How measurements are gated and weighted.

    Attributes
    ----------
    gate : float
        Radius of the per-marker gate, in sigmas.
    adapt : bool
        Whether the noise found in the innovations replaces ``start_noise``, and is added to the
        tracks' own in the update as in the gate; without it only the gate is wider.
    floor : float
        Smallest noise found in the innovations, px.
    start_noise : float
        Noise assumed before the first innovation, px.
    memory_frames : float
        Frames over which the noise is averaged.
    lockout_frames : int
        Frames with most markers rejected after which the shape is acquired again.
    scale_gain : float
        Share of an unexpected innovation that moves the process-noise scale, per frame.
    scale_range : tuple of float
        Smallest and largest process-noise scale.
    frame_s : float
        Time between frames, over which an unobserved rate shows, s.
    """

    gate: float = 5.0
    adapt: bool = True
    floor: float = 0.1
    start_noise: float = 1.0
    memory_frames: float = 60.0
    lockout_frames: int = 3
    scale_gain: float = 0.1
    scale_range: tuple[float, float] = (1e-3, 1e4)
    frame_s: float = 0.033


@dataclass(frozen=True, slots=True)
class AdaptiveNoise:
    """What the updates have found out so far: part of the filter's state, rewound with it.

    Attributes
    ----------
    pixel_variance : float
        Noise beyond the tracks' own that no shape explains, px^2.
    scale, scale_partial : float
        Process-noise scales, on the variance of the unobserved rates: while all pods deliver, and
        while some are silent.
    rejected_frames : int
        Consecutive frames in which most found markers were rejected.
    is_started : bool
        Whether the camera has fixed the shape once.
    frames : int
        Frames that the noise was averaged over.
    """

    pixel_variance: float
    scale: float = START_SCALE
    scale_partial: float = START_SCALE_PARTIAL
    rejected_frames: int = 0
    is_started: bool = False
    frames: int = 0

    def scale_of(self, live: tuple[bool, ...]) -> float:
        """Return the process-noise scale that holds for these live pods."""
        return self.scale if live and all(live) else self.scale_partial

    def with_scale(self, live: tuple[bool, ...], scale: float) -> "AdaptiveNoise":
        """Return the same with another process-noise scale for these live pods."""
        if live and all(live):
            return replace(self, scale=scale)
        return replace(self, scale_partial=scale)


def matched(
    noise: AdaptiveNoise,
    rules: UpdateRules,
    y: Array,
    H: Array,
    P: Array,
    *,
    variance: Array,
    prior: Array,
    unobserved: slice,
    live: tuple[bool, ...],
) -> AdaptiveNoise:
    """Return the noises after a frame, by covariance matching.

    Parameters
    ----------
    noise, rules : AdaptiveNoise, UpdateRules
        Before.
    y, H : ndarray, shapes (k, 2), (k, 2, size)
        Innovations of the used markers, px, and their Jacobians.
    P : ndarray, shape (size, size)
        Covariance before the update.
    variance : ndarray, shape (k,)
        The tracks' own, px^2.
    prior : ndarray, shape (n,)
        Prior variances of the amplitudes, rad^2.
    unobserved : slice
        Where the unobserved rates stand in the state.
    live : tuple of bool
        Which pods deliver.

    Notes
    -----
    The innovation is split into what some amplitudes could explain and the rest. The rest shows
    the pixel noise; the explained part, against its covariance, the process noise.
    """
    n = len(prior)
    y, H = y.ravel(), H.reshape(-1, H.shape[-1])
    scaled = H[:, :n] * np.sqrt(prior)
    reach, turned = np.linalg.eigh(scaled.T @ scaled)
    strong = reach > 1.0
    U = scaled @ (turned[:, strong] / np.sqrt(reach[strong]))
    explained = U.T @ y
    free = len(y) - U.shape[1]
    shown = noise.pixel_variance
    if free >= 2:
        rest = (y @ y - explained @ explained) / free - variance.mean()
        shown = min(max(float(rest), rules.floor**2), 16.0 * max(noise.pixel_variance, 1.0))
    frames = noise.frames + 1
    weight = max(1.0 / rules.memory_frames, 1.0 / (frames + 2))
    pixel_variance = noise.pixel_variance + weight * (shown - noise.pixel_variance)
    after = replace(noise, pixel_variance=pixel_variance, frames=frames)
    if unobserved.start == unobserved.stop or U.shape[1] == 0:
        return after
    pixel = float(variance.mean()) + noise.pixel_variance
    factor = _scale_factor(rules, explained, U.T @ H, P, pixel=pixel, unobserved=unobserved)
    smallest, largest = rules.scale_range
    return after.with_scale(live, min(max(noise.scale_of(live) * factor, smallest), largest))


def _scale_factor(
    rules: UpdateRules, explained: Array, UH: Array, P: Array, *, pixel: float, unobserved: slice
) -> float:
    """Return by what factor an innovation changes the process-noise scale.

    In proportion to the share of the unobserved rates in the innovation's expected size: a wing at
    rest shows nothing of the process noise.
    """
    directions = len(explained)
    S = UH @ P @ UH.T + pixel * np.eye(directions)
    nis = float(explained @ np.linalg.solve(S, explained)) / directions
    moves = UH[:, : unobserved.stop - unobserved.start]
    moved = float(((moves @ P[unobserved, unobserved]) * moves).sum())
    from_rates = rules.frame_s**2 * moved
    share = from_rates / (from_rates + directions * pixel)
    return float(np.exp(rules.scale_gain * share * (min(nis, 5.0) - 1.0)))
