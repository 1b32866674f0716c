"""Register map of the simulated ICM-42688-P: addresses, reset values, what can be written.

Written from the data sheet (TDK InvenSense ICM-42688-P, DS-000347 rev. 1.5, Sec. 13 to 17) on
purpose apart from ``drivers.icm42688.registers``: a slip in one of the two shows as a failing test.
"""

import numpy as np

# Bank 0.
DEVICE_CONFIG, DATA_FIRST, TEMP_DATA, ACCEL_DATA, GYRO_DATA = 0x11, 0x1D, 0x1D, 0x1F, 0x25
DATA_LAST, INT_STATUS, SIGNAL_PATH_RESET = 0x2A, 0x2D, 0x4B
INTF_CONFIG0, PWR_MGMT0 = 0x4C, 0x4E
GYRO_CONFIG0, ACCEL_CONFIG0, GYRO_CONFIG1 = 0x4F, 0x50, 0x51
GYRO_ACCEL_CONFIG0, ACCEL_CONFIG1 = 0x52, 0x53
REG_BANK_SEL = 0x76
# Bank 4.
OFFSET_USER0 = 0x77

BANKS = 5
RESET: tuple[dict[int, int], ...] = (
    {
        0x11: 0x00, 0x13: 0x05, 0x14: 0x00, 0x16: 0x00, 0x2D: 0x10, 0x30: 0xFF, 0x34: 0x04,
        0x4C: 0x30, 0x4D: 0x91, 0x4E: 0x00, 0x4F: 0x06, 0x50: 0x06, 0x51: 0x16, 0x52: 0x11,
        0x53: 0x0D, 0x54: 0x23, 0x56: 0x82, 0x57: 0x00, 0x5F: 0x00, 0x60: 0x00, 0x61: 0x00,
        0x62: 0x10, 0x63: 0x00, 0x64: 0x10, 0x65: 0x10, 0x66: 0x00, 0x68: 0x00, 0x69: 0x00,
        0x70: 0x00, 0x75: 0x47,
    },
    # 0x0F to 0x12 and the self-test data are trimmed for each device; these stand for one.
    {
        0x03: 0x80, 0x0B: 0xA0, 0x0C: 0x0D, 0x0D: 0xAA, 0x0E: 0x80, 0x0F: 0x51, 0x10: 0x4E,
        0x11: 0x60, 0x12: 0x38, 0x13: 0x11, 0x5F: 0x5A, 0x60: 0x61, 0x61: 0x58, 0x7A: 0x83,
        0x7B: 0x00, 0x7C: 0x5F,
    },
    {0x03: 0x30, 0x04: 0x40, 0x05: 0x62, 0x3B: 0x70, 0x3C: 0x74, 0x3D: 0x6C},
    {},
    {
        0x40: 0xA2, 0x41: 0x85, 0x42: 0x51, 0x43: 0xA4, 0x44: 0x8C, 0x45: 0x5C, 0x46: 0x45,
        0x47: 0x5B, 0x48: 0x00,
    },
)  # fmt: skip

WRITABLE: tuple[frozenset[int], ...] = (
    frozenset(
        {0x11, 0x13, 0x14, 0x16, 0x4B, *range(0x4C, 0x55), 0x56, 0x57, *range(0x5F, 0x67)}
        | {0x68, 0x69, 0x70}
    ),
    frozenset({0x03, *range(0x0B, 0x14), 0x5F, 0x60, 0x61, 0x7A, 0x7B, 0x7C}),
    frozenset({0x03, 0x04, 0x05, 0x3B, 0x3C, 0x3D}),
    frozenset(),
    frozenset({*range(0x40, 0x49), *range(0x4A, 0x52), *range(0x77, 0x80)}),
)
# Sec. 12.9: all else only while both sensors are off. A reset always works.
WRITABLE_RUNNING = frozenset(
    {DEVICE_CONFIG, SIGNAL_PATH_RESET, PWR_MGMT0, GYRO_CONFIG0, ACCEL_CONFIG0}
)

DATA_READY = 0x08
HOLD_LAST, DATA_BIG_ENDIAN = 0x80, 0x10
SPI_DISABLED, I2C_DISABLED = 0x02, 0x03

# Sec. 14.1 and 3.3.2: 1 ms after a reset, the ramp of the supply and 1 ms after power-up.
RESET_NS, POWER_UP_NS = 1_000_000, 4_000_000
# Sec. 14.36; 3.1 and 3.2 from off to valid data.
QUIET_NS, GYRO_START_NS, ACCEL_START_NS = 200_000, 30_000_000, 10_000_000

INVALID, LOWEST_VALID = -32768, -32766
GYRO_RANGE_DPS = (2000.0, 1000.0, 500.0, 250.0, 125.0, 62.5, 31.25, 15.625)
ACCEL_RANGE_G = (16.0, 8.0, 4.0, 2.0)
ODR_HZ = {
    1: 32000.0, 2: 16000.0, 3: 8000.0, 4: 4000.0, 5: 2000.0, 6: 1000.0, 7: 200.0, 8: 100.0,
    9: 50.0, 10: 25.0, 11: 12.5, 15: 500.0,
}  # fmt: skip
# Sec. 5.5, bandwidth at 1 kHz by order and GYRO_UI_FILT_BW 0 to 7, Hz.
UI_BANDWIDTH_HZ = (
    (498.3, 227.2, 188.9, 111.0, 92.4, 59.6, 48.8, 23.9),
    (493.3, 230.7, 191.6, 117.5, 97.1, 59.6, 48.0, 21.3),
    (492.9, 234.7, 195.8, 118.9, 97.9, 60.8, 46.8, 25.2),
)
# The same with its group delay at low frequency, decimation included: at 200 Hz for 1 to 7, where
# the table's digits say most (the bandwidth follows max(400 Hz, ODR)), at 25 Hz for 0, ms.
UI_DELAY_MS = (
    (21.0, 4.4, 5.0, 6.8, 7.6, 10.2, 11.7, 20.3),
    (25.7, 5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0),
    (31.8, 5.8, 6.8, 9.8, 11.4, 16.5, 20.4, 35.2),
)
UI_DELAY_BASE_HZ, BYPASS_DELAY_BASE_HZ = 400.0, 25.0
# The decimation alone: GYRO_UI_FILT_BW 14 at 1 kHz, and 15.
DECIMATION_HZ, DECIMATION_MS = 262.0, 1.5
LOW_LATENCY_HZ, LOW_LATENCY_MS = 2096.3, 0.2
# Sec. 5.3: GYRO_AAF_DELT 13, the reset value.
AAF_HZ = 585.0

STANDARD_GRAVITY = 9.80665
TEMP_LSB_PER_K, TEMP_ZERO_C = 132.48, 25.0
GYRO_OFFSET_LSB_DPS, ACCEL_OFFSET_LSB_G = 1 / 32, 0.5e-3
INT16 = np.iinfo(np.int16)
