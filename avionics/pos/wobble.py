"""Wobble of a vehicle about its path: sums of sinusoids, analytic and repeatable."""

from dataclasses import dataclass, replace

import numpy as np

from avionics.pos.compiled import Array
from avionics.pos.motion import Leg, Motion, along_legs

GOLDEN = 0.6180339887498949  # its multiples spread phases evenly


@dataclass(frozen=True, slots=True)
class Wobble:
    """Attitude against the path.

    Attributes
    ----------
    heading, pitch, roll : float
        Rms at speed, rad.
    from_hz, to_hz : float
        Range of frequencies; amplitudes fall as 1 / f.
    lines : int
        Number of sinusoids, spaced evenly in log f.
    fade_speed : float
        Speed at which half of it is left, m/s; none at standstill.
    """

    heading: float
    pitch: float
    roll: float
    from_hz: float = 0.05
    to_hz: float = 3.0
    lines: int = 24
    fade_speed: float = 2.0


def add_wobble(motion: Motion, legs: tuple[Leg, ...], wobble: Wobble, speed0: float) -> Motion:
    """Return the motion with the wobble added to its attitude.

    Parameters
    ----------
    motion : Motion
        Along ``legs``.
    legs : tuple of Leg
        Its table, for the speed.
    wobble : Wobble
        What to add.
    speed0 : float
        Speed at the start, m/s.
    """
    speed = along_legs(motion.t, legs, np.array([leg.speed_change for leg in legs]), 5.0)
    v = speed[0] + speed0
    half = wobble.fade_speed**2
    fade = v**2 / (v**2 + half)
    by_v = 2.0 * half * v / (v**2 + half) ** 2
    by_vv = 2.0 * half * (half - 3.0 * v**2) / (v**2 + half) ** 3
    fade1 = by_v * speed[1]
    fade2 = by_vv * speed[1] ** 2 + by_v * speed[2]
    euler, d1, d2 = (x.copy() for x in (motion.euler, motion.euler_d1, motion.euler_d2))
    for axis, rms in enumerate((wobble.heading, wobble.pitch, wobble.roll)):
        w0, w1, w2 = _sinusoids(motion.t, wobble, rms, axis)
        euler[:, axis] += fade * w0
        d1[:, axis] += fade * w1 + fade1 * w0
        d2[:, axis] += fade * w2 + 2.0 * fade1 * w1 + fade2 * w0
    return replace(motion, euler=euler, euler_d1=d1, euler_d2=d2)


def _sinusoids(t: Array, wobble: Wobble, rms: float, axis: int) -> tuple[Array, Array, Array]:
    """Value and two derivatives; neither frequencies nor phases of the axes coincide."""
    share = (np.arange(wobble.lines) + axis / 3.0) / wobble.lines
    frequency = 2.0 * np.pi * wobble.from_hz * (wobble.to_hz / wobble.from_hz) ** share
    amplitude = 1.0 / frequency
    amplitude *= rms / np.sqrt(0.5 * np.sum(amplitude**2))
    value, first, second = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for i in range(wobble.lines):
        w, a = frequency[i], amplitude[i]
        angle = w * t + 2.0 * np.pi * ((i * GOLDEN + axis / 3.0) % 1.0)
        s, c = np.sin(angle), np.cos(angle)
        value += a * s
        first += a * w * c
        second -= a * w * w * s
    return value, first, second
