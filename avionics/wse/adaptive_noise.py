"""What a frame shows, how it is to be believed, and what the updates remember and say."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

# Motion beyond pods and modes is a fraction of what mode shapes of equal static weight suggest.
START_SURPRISE = 0.1
# With a pod silent the shapes themselves are unseen.
START_SURPRISE_APART = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
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


@dataclass(frozen=True, slots=True)
class UpdateRules:
    """How measurements are believed.

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
        Frames with most markers rejected after which a way back is tried.
    surprise_gain : float
        Share of an unexpected innovation that moves the process noise, per frame.
    surprise_range : tuple of float
        Smallest and largest factor on the process noise.
    """

    gate: float = 5.0
    adapt: bool = True
    floor: float = 0.1
    start_noise: float = 1.0
    memory_frames: float = 60.0
    lockout_frames: int = 3
    surprise_gain: float = 0.1
    surprise_range: tuple[float, float] = (1e-3, 1e4)


@dataclass(frozen=True, slots=True)
class Trust:
    """What the updates remember: part of the filter's state, rewound with it.

    Attributes
    ----------
    noise : float
        Noise beyond the tracks' own that no shape explains, px^2.
    surprise, surprise_apart : float
        Factors on the variance of the unseen rates that make the innovations as large as
        expected: while all pods deliver, and while some are silent.
    rejected_frames : int
        Consecutive frames in which most found markers were rejected.
    is_started : bool
        Whether the camera has fixed the shape once.
    frames : int
        Frames that the noise was averaged over.
    """

    noise: float
    surprise: float = START_SURPRISE
    surprise_apart: float = START_SURPRISE_APART
    rejected_frames: int = 0
    is_started: bool = False
    frames: int = 0

    def scale(self, live: tuple[bool, ...]) -> float:
        """Return the factor that holds for these live pods."""
        return self.surprise if live and all(live) else self.surprise_apart

    def with_scale(self, live: tuple[bool, ...], scale: float) -> "Trust":
        """Return the same with another factor for these live pods."""
        if live and all(live):
            return replace(self, surprise=scale)
        return replace(self, surprise_apart=scale)


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What an update did.

    Attributes
    ----------
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
        Whether the state had become impossible and was begun anew.
    """

    used: Array
    found: int
    gated: int
    nis: float
    reacquired: bool = False
    locked_out: bool = False
    lost: bool = False


NO_VERDICT = Verdict(np.zeros(0, dtype=bool), 0, 0, float("nan"))
