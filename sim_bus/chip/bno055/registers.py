"""Register map of the simulated BNO055: addresses, power-on values, what can be written and when.

Written from the data sheet (BNO055 data sheet rev. 1.4, Tables 4-2 and 4-3) on purpose apart from
``drivers.bno055.registers``: a slip in one of the two shows as a failing test.
"""

from enum import IntEnum

import numpy as np

# Page 0.
CHIP_ID, PAGE_ID, ACC_DATA, MAG_DATA, GYR_DATA = 0x00, 0x07, 0x08, 0x0E, 0x14
EUL_DATA, QUA_DATA, LIA_DATA, GRV_DATA = 0x1A, 0x20, 0x28, 0x2E
TEMP, CALIB_STAT, ST_RESULT, SYS_CLK_STATUS, SYS_STATUS, SYS_ERR = (
    0x34,
    0x35,
    0x36,
    0x38,
    0x39,
    0x3A,
)
UNIT_SEL, OPR_MODE, PWR_MODE, SYS_TRIGGER = 0x3B, 0x3D, 0x3E, 0x3F
CALIB_FIRST, GYR_OFFSET, CALIB_LAST = 0x55, 0x61, 0x6A
# Page 1.
ACC_CONFIG, GYR_CONFIG_0, GYR_CONFIG_1 = 0x08, 0x0A, 0x0B
UNIQUE_ID = 0x50

DATA_FIRST, DATA_LAST = ACC_DATA, GRV_DATA + 5

PAGE_0_RESET = {
    0x00: 0xA0, 0x01: 0xFB, 0x02: 0x32, 0x03: 0x0F, 0x04: 0x11, 0x05: 0x03, 0x06: 0x15,
    ST_RESULT: 0x0F, UNIT_SEL: 0x80, 0x40: 0x02, 0x41: 0x24,
    0x43: 0x00, 0x44: 0x40, 0x4B: 0x00, 0x4C: 0x40, 0x53: 0x00, 0x54: 0x40,
    0x67: 0x00, 0x69: 0xE0, 0x6A: 0x01,
}  # fmt: skip
PAGE_1_RESET = {
    ACC_CONFIG: 0x0D, 0x09: 0x0B, GYR_CONFIG_0: 0x38, GYR_CONFIG_1: 0x00, 0x0C: 0x00, 0x0D: 0x00,
    0x11: 0x14, 0x12: 0x03, 0x13: 0x0F, 0x14: 0xC0, 0x15: 0x0A, 0x16: 0x0B, 0x18: 0x01, 0x19: 0x19,
    0x1A: 0x01, 0x1B: 0x19, 0x1C: 0x01, 0x1D: 0x19, 0x1E: 0x04, 0x1F: 0x0A,
}  # fmt: skip

# Only in CONFIG mode; OPR_MODE, SYS_TRIGGER and PAGE_ID always.
PAGE_0_WRITABLE = frozenset(
    {UNIT_SEL, OPR_MODE, PWR_MODE, SYS_TRIGGER, PAGE_ID, *range(0x40, 0x43), *range(0x43, 0x6B)}
)
PAGE_1_WRITABLE = frozenset({PAGE_ID, *range(0x08, 0x0E), *range(0x0F, 0x20)})
ALWAYS_WRITABLE = frozenset({OPR_MODE, SYS_TRIGGER, PAGE_ID})


class Mode(IntEnum):
    """Operation modes (Table 3-5)."""

    CONFIG = 0x00
    ACCONLY = 0x01
    MAGONLY = 0x02
    GYRONLY = 0x03
    ACCMAG = 0x04
    ACCGYRO = 0x05
    MAGGYRO = 0x06
    AMG = 0x07
    IMU = 0x08
    COMPASS = 0x09
    M4G = 0x0A
    NDOF_FMC_OFF = 0x0B
    NDOF = 0x0C

    @property
    def is_fusion(self) -> bool:
        """Whether the chip computes an attitude and forces the sensors' configuration."""
        return self >= Mode.IMU

    @property
    def has_gyro(self) -> bool:
        """Whether the gyroscope runs."""
        return self in {3, 5, 6, 7, 8, 0x0B, 0x0C}

    @property
    def has_accelerometer(self) -> bool:
        """Whether the accelerometer runs."""
        return self in {1, 4, 5, 7, 8, 9, 0x0A, 0x0B, 0x0C}

    @property
    def has_magnetometer(self) -> bool:
        """Whether the magnetometer runs."""
        return self in {2, 4, 6, 7, 9, 0x0A, 0x0B, 0x0C}


GYRO_RANGE_DPS = (2000.0, 1000.0, 500.0, 250.0, 125.0)
GYRO_BANDWIDTH_HZ = (523.0, 230.0, 116.0, 47.0, 23.0, 12.0, 64.0, 32.0)
# How often the gyro has new data at each bandwidth (BMX055 data sheet, the same die, Table 30);
# the fusion modes deliver 100 Hz (Table 3-14).
GYRO_DATA_HZ = (2000.0, 2000.0, 1000.0, 400.0, 200.0, 100.0, 200.0, 100.0)
FUSION_DATA_HZ = 100.0
ACC_RANGE_G = (2.0, 4.0, 8.0, 16.0)
ACC_BANDWIDTH_HZ = (7.81, 15.63, 31.25, 62.5, 125.0, 250.0, 500.0, 1000.0)

# Table 3-6; the reset time of Table 0-2 is 650 ms, in which nothing answers.
TO_CONFIG_NS, FROM_CONFIG_NS = 19_000_000, 7_000_000
RESET_NS, SELF_TEST_NS = 650_000_000, 400_000_000

STANDARD_GRAVITY = 9.80665
ACC_LSB_PER_M_S2, ACC_LSB_PER_MG = 100.0, 1.0
FUSION_LSB_PER_DPS, FUSION_LSB_PER_RAD_S = 16.0, 900.0
MAG_LSB_PER_T = 16e6
INT16 = np.iinfo(np.int16)
