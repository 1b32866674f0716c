"""Distinguishes a good burst of the BNO055 from one that was read wrong; pure functions."""

from typing import Final

import numpy as np

from drivers.burst import Words, agree

# A false bit 7 of a low byte adds 128; the margin is what the extrapolation may be wrong by when
# one burst caught no new data and the next two at once.
BIT_7: Final = 0x80
BIT_7_MARGIN: Final = 90


def words(data: bytes) -> Words:
    """Return the little-endian signed words of a burst, shape (n,)."""
    return np.frombuffer(data, dtype="<i2").astype(np.int32)


def is_suspicious(values: Words, expected: Words, step_limit: Words) -> bool:
    """Whether a burst looks as if a bit had been read wrong.

    Parameters
    ----------
    values, expected : ndarray of int, shape (n,)
        This burst, and the one predicted from the last good ones; the last three words are
        the gyro's.
    step_limit : ndarray of int, shape (n,)
        Largest departure that is taken without a second look.

    Notes
    -----
    An I2C controller that samples early while the chip stretches the clock reads bit 7 of a byte
    as 1. In a high byte that is a step of 32768 and the limit sees it. In a low byte it adds 128;
    the gyro is smooth enough between two samples to see that too, the accelerometer is not.
    """
    if not agree(values, expected, step_limit):
        return True
    departure = values - expected
    has_bit = (values[-3:] & BIT_7) != 0
    is_128_off = np.abs(departure[-3:] - BIT_7) < BIT_7_MARGIN
    return bool((has_bit & is_128_off).any())
