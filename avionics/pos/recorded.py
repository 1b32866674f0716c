"""A recorded drive or flight as carrier: sampled attitude and velocity to a smooth exact motion."""

import numpy as np
from scipy.interpolate import make_interp_spline

from avionics.pos.compiled import Array
from avionics.pos.motion import Motion, half_step_times

DEGREE = 5  # of the spline: rates of rates stay continuous


def motion_from_samples(t: Array, euler: Array, velocity: Array, dt: float) -> Motion:
    """Return the motion through recorded samples.

    Parameters
    ----------
    t : ndarray, shape (K,)
        Increasing, from 0, s.
    euler : ndarray, shape (K, 3)
        Heading (unwrapped), pitch, roll, rad, already low-passed to the band that is valid.
    velocity : ndarray, shape (K, 3)
        East, north, up, m/s, likewise.
    dt : float
        Step of the trajectory to be made, s.

    Raises
    ------
    ValueError
        If the times do not increase from zero.
    """
    if t[0] != 0.0 or np.any(np.diff(t) <= 0.0):
        msg = (
            f"recorded times must increase from 0, found {t[0]} s and a step of {np.diff(t).min()}"
        )
        raise ValueError(msg)
    times = half_step_times(float(np.floor(t[-1] / dt)) * dt, dt)
    attitude = make_interp_spline(t, euler, k=DEGREE)
    speed = make_interp_spline(t, velocity, k=DEGREE)
    return Motion(
        t=times,
        euler=attitude(times),
        euler_d1=attitude(times, 1),
        euler_d2=attitude(times, 2),
        velocity=speed(times),
        velocity_d1=speed(times, 1),
    )
