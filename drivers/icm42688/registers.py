"""Registers, bits and scale factors of the ICM-42688-P.

TDK InvenSense ICM-42688-P, DS-000347 rev. 1.5, Sec. 5 and 12 to 15; addresses and bits agree with
the drivers of Linux (inv_icm42600), Zephyr and PX4. Left out: FIFO, interrupt pins, time stamps,
motion detection, self-test, notch and anti-alias filter, which stay at their reset values.
"""

import math
from typing import Final

CHIP_ID_VALUE: Final = 0x47

# Every bank
BANK_SEL: Final = 0x76
HIGHEST_BANK: Final = 4

# Bank 0
DEVICE_CONFIG: Final = 0x11
DRIVE_CONFIG: Final = 0x13
ACCEL_DATA: Final = 0x1F
GYRO_DATA: Final = 0x25
INT_STATUS: Final = 0x2D
INTF_CONFIG0: Final = 0x4C
INTF_CONFIG1: Final = 0x4D
PWR_MGMT0: Final = 0x4E
GYRO_CONFIG0: Final = 0x4F
ACCEL_CONFIG0: Final = 0x50
GYRO_CONFIG1: Final = 0x51
GYRO_ACCEL_CONFIG0: Final = 0x52
ACCEL_CONFIG1: Final = 0x53
CHIP_ID: Final = 0x75

# Bank 1
INTF_CONFIG6: Final = 0x7C

SOFT_RESET: Final = 0x01
RESET_DONE: Final = 0x10
# Data big-endian, invalid data marked (Sec. 14.34), the interface that is not used switched off.
BIG_ENDIAN_SPI_ONLY: Final = 0x33
BIG_ENDIAN_I2C_ONLY: Final = 0x32
# Sec. 12.3: slew rates and I3C for a chip on I2C; on SPI the reset values are right.
I2C_SLEW_RATE: Final = 0x09
I3C_OFF: Final = 0x5C
# The reset value with bits 7:6 = 01: the adaptive full-scale range off. It is on after a reset and
# makes the gyro stand still for 1 to 2 ms when a rate passes 100 deg/s. The bits are not in the
# data sheet; ArduPilot (pull request 25332), Betaflight (13132) and PX4 (22254) found them.
NO_ADAPTIVE_RANGE: Final = 0x51
GYRO_LOW_NOISE: Final = 0x0C
ACCEL_LOW_NOISE: Final = 0x03

# Sec. 12.8, 14.34: no valid sample reads so.
INVALID: Final = -32768
LOWEST_VALID: Final = -32766
HIGHEST_VALID: Final = 32767

# Sec. 3.3.2 and 14.1: 1 ms; some boards hold the supply back.
RESET_NS: Final = 2_000_000
START_TIMEOUT_NS: Final = 100_000_000
# Sec. 3.1: the gyro's drive is ready after 30 ms, typically; the Linux driver waits 60 ms. That is
# above the 45 ms for which the gyro must stay on, and the 200 us without a write (Sec. 14.36).
GYRO_START_NS: Final = 60_000_000
DATA_TIMEOUT_NS: Final = 200_000_000

GYRO_RANGE_BITS: Final = {2000: 0, 1000: 1, 500: 2, 250: 3, 125: 4}
ACCEL_RANGE_BITS: Final = {16: 0, 8: 1, 4: 2, 2: 3}
DATA_RATE_BITS: Final = {1000: 6, 500: 15, 200: 7}
STANDARD_GRAVITY: Final = 9.80665
# Sec. 5.3: bandwidth of the anti-alias filter, second order, at its reset value.
ANTI_ALIAS_HZ: Final = 585.0

# Sec. 5.5, GYRO_UI_FILT_BW 1 to 7 by order: bandwidth, Hz, and group delay, ms, where the filter
# runs at 400 Hz; at a higher output data rate both scale with it. 0 and the low-latency settings
# let pass what a poll would alias.
FILTER_BASE_HZ: Final = 400.0
FILTER_BANDWIDTH_HZ: Final = {
    1: (90.9, 75.5, 44.4, 37.0, 23.8, 19.5, 9.6),
    2: (92.3, 76.6, 47.0, 38.8, 23.8, 19.2, 8.5),
    3: (93.9, 78.3, 47.6, 39.2, 24.3, 18.7, 10.1),
}
FILTER_DELAY_MS: Final = {
    1: (4.4, 5.0, 6.8, 7.6, 10.2, 11.7, 20.3),
    2: (5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0),
    3: (5.8, 6.8, 9.8, 11.4, 16.5, 20.4, 35.2),
}


def gyro_scale_rad_s(range_dps: int) -> float:
    """Return what one LSB of the gyro registers is worth, rad/s.

    Notes
    -----
    Full scale over 32768; the 16.4 LSB per deg/s of Sec. 3.1 is this, rounded.
    """
    return math.radians(range_dps / 32768)


def accel_scale_m_s2(range_g: int) -> float:
    """Return what one LSB of the accelerometer registers is worth, m/s^2."""
    return range_g * STANDARD_GRAVITY / 32768


def filter_bandwidths_hz(order: int, data_hz: int) -> tuple[int, ...]:
    """Return the bandwidths of the low-pass at one order and output data rate, whole Hz.

    In the order of GYRO_UI_FILT_BW 1, 2, ...
    """
    scale = max(FILTER_BASE_HZ, data_hz) / FILTER_BASE_HZ
    return tuple(math.floor(hz * scale + 0.5) for hz in FILTER_BANDWIDTH_HZ[order])
