"""Registers, bits and scale factors of the BNO055.

BNO055 data sheet rev. 1.4, Sec. 3 and 4. Left out: interrupts, Euler angles, quaternions.
"""

import math
from enum import IntEnum
from typing import Final

CHIP_ID_VALUE: Final = 0xA0

# Page 0
CHIP_ID: Final = 0x00
PAGE_ID: Final = 0x07  # on both pages
ACC_DATA: Final = 0x08
MAG_DATA: Final = 0x0E
GYR_DATA: Final = 0x14
TEMP: Final = 0x34
CALIB_STAT: Final = 0x35
ST_RESULT: Final = 0x36
SYS_CLK_STATUS: Final = 0x38
SYS_STATUS: Final = 0x39
SYS_ERR: Final = 0x3A
UNIT_SEL: Final = 0x3B
OPR_MODE: Final = 0x3D
PWR_MODE: Final = 0x3E
SYS_TRIGGER: Final = 0x3F
CALIBRATION: Final = 0x55
CALIBRATION_LENGTH: Final = 22
ACC_OFFSET: Final = 0x55
GYR_OFFSET: Final = 0x61

# Page 1
ACC_CONFIG: Final = 0x08
GYR_CONFIG_0: Final = 0x0A
GYR_CONFIG_1: Final = 0x0B
UNIQUE_ID: Final = 0x50
UNIQUE_ID_LENGTH: Final = 16

SELF_TEST_PASSED: Final = 0x0F
SELF_TEST_PARTS: Final = ("accelerometer", "magnetometer", "gyroscope", "microcontroller")
RESET_SYSTEM: Final = 0x20
EXTERNAL_CRYSTAL: Final = 0x80
POWER_NORMAL: Final = 0x00
GYRO_POWER_NORMAL: Final = 0x00
# m/s^2, deg/s, degrees Celsius; orientation bit at its reset value.
UNITS: Final = 0x80
ACC_16G_62HZ: Final = 0x0F

# Sec. 3.3, table 3-6: 7 ms and 19 ms; the Linux driver waits 20 ms both ways.
MODE_SWITCH_NS: Final = 20_000_000
RESET_NS: Final = 650_000_000
START_TIMEOUT_NS: Final = 1_000_000_000
CRYSTAL_SWITCH_NS: Final = 10_000_000


class Mode(IntEnum):
    """Values of OPR_MODE that we use."""

    CONFIG = 0x00
    GYRONLY = 0x03
    AMG = 0x07
    IMU = 0x08
    NDOF = 0x0C

    @property
    def is_fusion(self) -> bool:
        """Whether the chip fuses, and then overrides range and bandwidth."""
        return self >= Mode.IMU

    @property
    def has_accel(self) -> bool:
        """Whether the accelerometer runs."""
        return self in (Mode.AMG, Mode.IMU, Mode.NDOF)

    @property
    def has_mag(self) -> bool:
        """Whether the magnetometer runs."""
        return self in (Mode.AMG, Mode.NDOF)


GYRO_RANGE_BITS: Final = {2000: 0, 1000: 1, 500: 2, 250: 3, 125: 4}
GYRO_BANDWIDTH_BITS: Final = {523: 0, 230: 1, 116: 2, 47: 3, 23: 4, 12: 5, 64: 6, 32: 7}
# How often the data registers change, by bandwidth; BMI055 data sheet, register RANGE/BW.
GYRO_DATA_HZ: Final = {523: 2000, 230: 2000, 116: 1000, 47: 400, 23: 200, 12: 100, 64: 200, 32: 100}
# What the fusion modes set, whatever is configured; Sec. 3.3, table 3-14.
FUSION_DATA_HZ: Final = 100
FUSION_BANDWIDTH_HZ: Final = 32

ACCEL_SCALE_M_S2: Final = 0.01
MAG_SCALE_T: Final = 1e-6 / 16
GYRO_FUSION_SCALE_DPS: Final = 1 / 16
# Offsets are in fusion units whatever the range; Sec. 3.6.4.
GYRO_OFFSET_SCALE_RAD_S: Final = math.radians(1 / 16)


def gyro_config(range_dps: int, bandwidth_hz: int) -> int:
    """Return GYR_CONFIG_0 for a range and a bandwidth.

    Raises
    ------
    ValueError
        If the chip does not have such a range or bandwidth.
    """
    if range_dps not in GYRO_RANGE_BITS or bandwidth_hz not in GYRO_BANDWIDTH_BITS:
        msg = (
            f"gyro range {range_dps} deg/s, bandwidth {bandwidth_hz} Hz: wanted one of "
            f"{sorted(GYRO_RANGE_BITS)} and {sorted(GYRO_BANDWIDTH_BITS)}"
        )
        raise ValueError(msg)
    return GYRO_BANDWIDTH_BITS[bandwidth_hz] << 3 | GYRO_RANGE_BITS[range_dps]


def gyro_scale_rad_s(mode: Mode, range_dps: int) -> float:
    """Return what one LSB of the gyro registers is worth, rad/s.

    Notes
    -----
    The data sheet (table 3-22) claims 1/16 deg/s always. It holds in fusion modes; in raw modes
    the registers are the gyroscope's own, full scale over 32768 (Linux driver; checked on a
    recorded NDOF register file against the quaternion rate for the fusion part).
    """
    return math.radians(GYRO_FUSION_SCALE_DPS if mode.is_fusion else range_dps / 32768)
