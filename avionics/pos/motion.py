"""What the carrier does: tables of legs to attitude and velocity as functions of time."""

from dataclasses import dataclass

import numpy as np

from avionics.pos.compiled import Array
from avionics.pos.earth import STANDARD_GRAVITY


@dataclass(frozen=True, slots=True)
class Leg:
    """One row of the waypoint table.

    Attributes
    ----------
    duration : float
        s.
    turn : float
        Change of heading, rad, clockwise positive.
    speed_change : float
        m/s.
    climb : float
        Change of height, m.
    """

    duration: float
    turn: float = 0.0
    speed_change: float = 0.0
    climb: float = 0.0


@dataclass(frozen=True, slots=True)
class Start:
    """Where and how a trajectory begins: rad, m, m/s."""

    latitude: float
    longitude: float
    height: float
    heading: float
    speed: float


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Attitude and velocity as functions of time, sampled at times ``t``.

    Attributes
    ----------
    t : ndarray, shape (K,)
        s.
    euler, euler_d1, euler_d2 : ndarray, shape (K, 3)
        Heading, pitch, roll and their derivatives: rad, rad/s, rad/s^2.
    velocity, velocity_d1 : ndarray, shape (K, 3)
        East, north, up and derivative: m/s, m/s^2.
    """

    t: Array
    euler: Array
    euler_d1: Array
    euler_d2: Array
    velocity: Array
    velocity_d1: Array


def ramped_profile(x: Array, duration: float, ramp: float) -> tuple[Array, Array, Array, Array]:
    """Return integral, value, first and second derivative of a trapezoid of unit integral.

    Parameters
    ----------
    x : ndarray, shape (K,)
        Time since the start of the leg, s; inside 0..duration.
    duration, ramp : float
        Length of the leg and of each half-cosine ramp inside it, s.

    Returns
    -------
    tuple of ndarray, shape (K,)
        Integral (0 to 1), rate 1/s, 1/s^2, 1/s^3.
    """
    top = 1.0 / (duration - ramp)
    falls = x > duration - ramp
    y = np.where(falls, duration - x, x)
    flat = y >= ramp
    w = np.pi / ramp
    y = np.minimum(y, ramp)
    rise = 0.5 * top * (y - np.sin(w * y) / w)
    integral = np.where(falls, 1.0 - rise, np.where(flat, top * (x - 0.5 * ramp), rise))
    value = np.where(flat, top, 0.5 * top * (1.0 - np.cos(w * y)))
    slope = np.where(flat, 0.0, np.where(falls, -1.0, 1.0) * 0.5 * top * w * np.sin(w * y))
    bend = np.where(flat, 0.0, 0.5 * top * w * w * np.cos(w * y))
    return integral, value, slope, bend


def along_legs(t: Array, legs: tuple[Leg, ...], totals: Array, ramp: float) -> Array:
    """Return the quantity that changes by ``totals`` leg by leg, and three derivatives."""
    ends = np.cumsum([leg.duration for leg in legs])
    index = np.minimum(np.searchsorted(ends, t, side="left"), len(legs) - 1)
    before = np.concatenate([[0.0], np.cumsum(totals)])
    result = np.zeros((4, len(t)))
    for i, leg in enumerate(legs):
        mine = index == i
        x = t[mine] - (ends[i] - leg.duration)
        if totals[i] != 0.0:
            result[:, mine] = totals[i] * np.array(ramped_profile(x, leg.duration, ramp))
        result[0, mine] += before[i]
    return result


def motion_along_legs(
    t: Array, legs: tuple[Leg, ...], start: Start, *, banked: bool = True, ramp: float = 5.0
) -> Motion:
    """Return the motion that a waypoint table describes.

    Parameters
    ----------
    t : ndarray, shape (K,)
        s, from 0 to the sum of the durations.
    legs : tuple of Leg
        The table.
    start : Start
        Initial heading and speed (position is not used here).
    banked : bool
        Coordinated turns, roll = arctan(v psi_dot / g); False keeps the roll at zero.
    ramp : float
        Length of the half-cosine ramps inside each leg, s.

    Raises
    ------
    ValueError
        If a leg is shorter than its two ramps, or climbs at standstill or straight up.
    """
    for i, leg in enumerate(legs):
        if leg.duration < 2.0 * ramp and (leg.turn or leg.speed_change or leg.climb):
            msg = f"leg {i + 1}: lasts {leg.duration} s, wants at least two ramps, {2 * ramp} s"
            raise ValueError(msg)
    psi = along_legs(t, legs, np.array([leg.turn for leg in legs]), ramp)
    v = along_legs(t, legs, np.array([leg.speed_change for leg in legs]), ramp)
    psi[0] += start.heading
    v[0] += start.speed
    theta = _climb_angle(along_legs(t, legs, np.array([leg.climb for leg in legs]), ramp), v)
    gamma = _bank_angle(psi, v) if banked else np.zeros((3, len(t)))
    s_psi, c_psi, s_theta, c_theta = (
        np.sin(psi[0]),
        np.cos(psi[0]),
        np.sin(theta[0]),
        np.cos(theta[0]),
    )
    forward = np.stack([s_psi * c_theta, c_psi * c_theta, s_theta], axis=-1)
    turning = np.stack([c_psi * c_theta, -s_psi * c_theta, 0.0 * s_psi], axis=-1)
    rising = np.stack([-s_psi * s_theta, -c_psi * s_theta, c_theta], axis=-1)
    return Motion(
        t=t,
        euler=np.stack([psi[0], theta[0], gamma[0]], axis=-1),
        euler_d1=np.stack([psi[1], theta[1], gamma[1]], axis=-1),
        euler_d2=np.stack([psi[2], theta[2], gamma[2]], axis=-1),
        velocity=v[0][:, None] * forward,
        velocity_d1=v[1][:, None] * forward
        + (v[0] * psi[1])[:, None] * turning
        + (v[0] * theta[1])[:, None] * rising,
    )


def _climb_angle(height: Array, v: Array) -> Array:
    """Flight-path angle asin(h_dot / v) and two derivatives, shape (3, K)."""
    climbs = height[1] != 0.0
    if np.any(np.abs(height[1][climbs]) >= v[0][climbs]):
        msg = "a climb wants a vertical speed below the airspeed"
        raise ValueError(msg)
    speed = np.where(climbs, v[0], 1.0)
    y = height[1] / speed
    y1 = (height[2] - y * v[1]) / speed
    y2 = (height[3] - 2.0 * y1 * v[1] - y * v[2]) / speed
    y, y1, y2 = (np.where(climbs, item, 0.0) for item in (y, y1, y2))
    c = np.sqrt(1.0 - y * y)
    return np.array([np.arcsin(y), y1 / c, y2 / c + y * y1**2 / c**3])


def _bank_angle(psi: Array, v: Array) -> Array:
    """Roll of a coordinated turn, arctan(v psi_dot / g), and two derivatives, shape (3, K)."""
    g = STANDARD_GRAVITY
    x = v[0] * psi[1] / g
    x1 = (v[1] * psi[1] + v[0] * psi[2]) / g
    x2 = (v[2] * psi[1] + 2.0 * v[1] * psi[2] + v[0] * psi[3]) / g
    c2 = 1.0 / (1.0 + x * x)
    return np.array([np.arctan(x), x1 * c2, x2 * c2 - 2.0 * x * x1**2 * c2**2])


def half_step_times(duration: float, dt: float) -> Array:
    """Return 0, dt/2, dt, ..., duration, s: the instants a ``Motion`` is sampled at."""
    steps = round(duration / dt)
    return np.linspace(0.0, steps * dt, 2 * steps + 1)
