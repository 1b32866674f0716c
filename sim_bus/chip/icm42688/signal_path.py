"""What the registers of the simulated ICM-42688-P make of the signal, and of its numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_bus.chip.icm42688 import registers as reg
from sim_bus.chip.sensing import FloatArray, Latch


@dataclass(frozen=True, slots=True)
class SignalPath:
    """Filters, rate and ranges as the registers of bank 0 set them (Sec. 5).

    Attributes
    ----------
    gyro_hz, accel_hz : float
        Bandwidths of the low-passes, Hz.
    orders : tuple of int
        Their orders.
    data_hz : float
        Output data rate of the gyro, Hz.
    delay_s : float
        Delay from the gyro to its register at low frequency: anti-alias filter, decimation and
        low-pass, s.
    gyro_range_dps, accel_range_g : float
        Full scales.
    """

    gyro_hz: float
    accel_hz: float
    orders: tuple[int, int]
    data_hz: float
    delay_s: float
    gyro_range_dps: float
    accel_range_g: float

    @classmethod
    def of(cls, bank: bytearray) -> "SignalPath":
        """Read the settings from bank 0."""
        data_hz = reg.ODR_HZ.get(bank[reg.GYRO_CONFIG0] & 0x0F, 1000.0)
        gyro_order = min(bank[reg.GYRO_CONFIG1] >> 2 & 0x03, 2)
        accel_order = min(bank[reg.ACCEL_CONFIG1] >> 3 & 0x03, 2)
        bandwidths = bank[reg.GYRO_ACCEL_CONFIG0]
        gyro_hz, delay_s = ui_filter(gyro_order, bandwidths & 0x0F, data_hz)
        accel_hz, _ = ui_filter(accel_order, bandwidths >> 4, data_hz)
        aaf_s = np.sqrt(2) / (2 * np.pi * reg.AAF_HZ)
        return cls(
            gyro_hz=gyro_hz,
            accel_hz=accel_hz,
            orders=(gyro_order + 1, accel_order + 1),
            data_hz=data_hz,
            delay_s=delay_s + float(aaf_s),
            gyro_range_dps=reg.GYRO_RANGE_DPS[bank[reg.GYRO_CONFIG0] >> 5],
            accel_range_g=reg.ACCEL_RANGE_G[bank[reg.ACCEL_CONFIG0] >> 5 & 0x03],
        )


def ui_filter(order: int, bandwidth: int, data_hz: float) -> tuple[float, float]:
    """Return the bandwidth of the UI filter, Hz, and its delay with the decimation, s.

    Parameters
    ----------
    order, bandwidth : int
        GYRO_UI_FILT_ORD and GYRO_UI_FILT_BW, or the accelerometer's.
    data_hz : float
        Output data rate, Hz.
    """
    base_hz = max(400.0, data_hz)
    if bandwidth == 15:
        scale = max(200.0, 8 * data_hz) / 8000.0
        return reg.LOW_LATENCY_HZ * scale, 1e-3 * reg.LOW_LATENCY_MS / scale
    if data_hz > 1000 or bandwidth > 7:
        return reg.DECIMATION_HZ * base_hz / 1e3, 1e-3 * reg.DECIMATION_MS * 1e3 / base_hz
    corner_hz, delay_ms = reg.UI_BANDWIDTH_HZ[order][bandwidth], reg.UI_DELAY_MS[order][bandwidth]
    if bandwidth == 0:
        return corner_hz * data_hz / 1e3, 1e-3 * delay_ms * reg.BYPASS_DELAY_BASE_HZ / data_hz
    return corner_hz * base_hz / 1e3, 1e-3 * delay_ms * reg.UI_DELAY_BASE_HZ / base_hz


def data_registers(
    banks: Sequence[bytearray], latch: Latch, path: SignalPath, *, gyro: bool, accel: bool
) -> None:
    """Write one latch into the data registers; a sensor that gives no data keeps its last.

    Parameters
    ----------
    banks : sequence of bytearray
        All register banks; the data go to bank 0, the user's offsets are in bank 4.
    latch : Latch
        Filtered motion with the chip's errors.
    path : SignalPath
        Ranges.
    gyro, accel : bool
        Whether the sensor has valid data.
    """
    bank = banks[0]
    temperature = (latch.temperature_c - reg.TEMP_ZERO_C) * reg.TEMP_LSB_PER_K
    _put(bank, reg.TEMP_DATA, np.array([temperature]))
    gyro_offset_dps, accel_offset_g = user_offsets(banks[4])
    if accel:
        force_g = latch.specific_force_m_s2 / reg.STANDARD_GRAVITY + accel_offset_g
        _put(bank, reg.ACCEL_DATA, force_g * (32768 / path.accel_range_g))
    if gyro:
        rate_dps = np.degrees(latch.rate_rad_s) + gyro_offset_dps
        _put(bank, reg.GYRO_DATA, rate_dps * (32768 / path.gyro_range_dps))


def _put(bank: bytearray, register: int, value: FloatArray) -> None:
    """Store words, rounded and saturated; -32768 is kept for invalid data (Sec. 14.34)."""
    config = bank[reg.INTF_CONFIG0]
    lowest = reg.INT16.min if config & reg.HOLD_LAST else reg.LOWEST_VALID
    order = ">i2" if config & reg.DATA_BIG_ENDIAN else "<i2"
    data = np.clip(np.rint(value), lowest, reg.INT16.max).astype(order).tobytes()
    bank[register : register + len(data)] = data


def user_offsets(bank: bytearray) -> tuple[FloatArray, FloatArray]:
    """Return the offsets that the user programmed into bank 4 (Sec. 5.4), deg/s and g."""
    b = bank[reg.OFFSET_USER0 : reg.OFFSET_USER0 + 9]
    words = [
        (b[1] & 0x0F) << 8 | b[0], (b[1] >> 4) << 8 | b[2], (b[4] & 0x0F) << 8 | b[3],
        (b[4] >> 4) << 8 | b[5], (b[7] & 0x0F) << 8 | b[6], (b[7] >> 4) << 8 | b[8],
    ]  # fmt: skip
    signed = np.array([w - 4096 if w & 0x800 else w for w in words], dtype=np.float64)
    return signed[:3] * reg.GYRO_OFFSET_LSB_DPS, signed[3:] * reg.ACCEL_OFFSET_LSB_G
