"""What the simulated BNO055 writes into its data registers 0x08 to 0x34 for one latch."""

import numpy as np
from numpy.typing import NDArray

from sim_bus.chip.bno055 import registers as reg
from sim_bus.chip.bno055.registers import Mode
from sim_bus.chip.sensing import FloatArray, Latch


def counts(value: FloatArray) -> bytes:
    """Return little-endian int16, rounded and saturated."""
    return np.clip(np.rint(value), reg.INT16.min, reg.INT16.max).astype("<i2").tobytes()


def data_registers(
    latch: Latch,
    *,
    mode: Mode,
    registers: bytearray,
    gyro_runs: bool,
    gyro_range_rad_s: float,
    gyro_rad_s_per_lsb: float,
    acc_range_g: float,
    attitude: FloatArray | None,
) -> bytes:
    """Return the bytes of registers 0x08 to 0x34 of page 0.

    Parameters
    ----------
    latch : Latch
        Filtered motion with the chip's errors.
    mode : Mode
        Operation mode; sensors that it leaves off read zero.
    registers : bytearray
        Page 0, for the unit selection and the offset registers. The offsets are applied in the
        fusion modes alone (raw modes leave that to the host).
    gyro_runs : bool
        Whether the gyro is powered.
    gyro_range_rad_s, gyro_rad_s_per_lsb : float
        Saturation and value of one count, rad/s.
    acc_range_g : float
        Saturation of the accelerometer, g.
    attitude : ndarray, shape (3, 3), or None
        Earth to sensor, in a fusion mode.
    """
    data = bytearray(reg.TEMP + 1 - reg.DATA_FIRST)

    def put(register: int, content: bytes) -> None:
        data[register - reg.DATA_FIRST : register - reg.DATA_FIRST + len(content)] = content

    per_m_s2 = _acc_lsb_per_m_s2(registers[reg.UNIT_SEL])
    if mode.has_accelerometer:
        limit = acc_range_g * reg.STANDARD_GRAVITY
        put(reg.ACC_DATA, counts(np.clip(latch.specific_force_m_s2, -limit, limit) * per_m_s2))
    if mode.has_magnetometer:
        put(reg.MAG_DATA, counts(latch.flux_t * reg.MAG_LSB_PER_T))
    if gyro_runs:
        rate = np.clip(latch.rate_rad_s, -gyro_range_rad_s, gyro_range_rad_s)
        if mode.is_fusion:
            rate = rate - _gyro_offset_rad_s(registers)
        put(reg.GYR_DATA, counts(rate / gyro_rad_s_per_lsb))
    if attitude is not None:
        _put_attitude(put, registers[reg.UNIT_SEL], latch, attitude, per_m_s2)
    fahrenheit = bool(registers[reg.UNIT_SEL] & 0x10)
    degrees = latch.temperature_c * 0.9 + 16 if fahrenheit else latch.temperature_c
    put(reg.TEMP, int(np.clip(round(degrees), -128, 127)).to_bytes(1, "little", signed=True))
    return bytes(data)


def _acc_lsb_per_m_s2(unit_select: int) -> float:
    if unit_select & 0x01:
        return 1000 / reg.STANDARD_GRAVITY * reg.ACC_LSB_PER_MG
    return reg.ACC_LSB_PER_M_S2


def _gyro_offset_rad_s(registers: bytearray) -> FloatArray:
    raw = np.frombuffer(bytes(registers[reg.GYR_OFFSET : reg.GYR_OFFSET + 6]), dtype="<i2")
    return np.asarray(np.radians(raw / reg.FUSION_LSB_PER_DPS), dtype=np.float64)


def _put_attitude(
    put: object, unit_select: int, latch: Latch, attitude: FloatArray, per_m_s2: float
) -> None:
    assert callable(put)
    w, x, y, z = quaternion(attitude)
    put(reg.QUA_DATA, counts(np.array([w, x, y, z]) * (1 << 14)))
    heading = np.arctan2(attitude[0, 1], attitude[0, 0]) % (2 * np.pi)
    roll = np.arctan2(attitude[1, 2], attitude[2, 2])
    pitch = -np.arcsin(np.clip(attitude[0, 2], -1, 1))
    scale = 900.0 if unit_select & 0x04 else np.degrees(1.0) * 16
    put(reg.EUL_DATA, counts(np.array([heading, roll, pitch]) * scale))
    gravity = attitude @ np.array([0.0, 0.0, -reg.STANDARD_GRAVITY])
    put(reg.GRV_DATA, counts(gravity * per_m_s2))
    put(reg.LIA_DATA, counts((latch.specific_force_m_s2 - gravity) * per_m_s2))


def quaternion(dcm: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return (w, x, y, z), w >= 0, of the rotation that takes sensor to earth.

    Parameters
    ----------
    dcm : ndarray, shape (3, 3)
        Direction cosine matrix, earth to sensor.
    """
    # The largest of the four squares keeps the division safe (Shepperd).
    trace = float(np.trace(dcm))
    squares = np.array([trace, *np.diag(dcm) * 2 - trace])
    best = int(np.argmax(squares))
    q = np.empty(4)
    q[best] = 0.5 * np.sqrt(1 + squares[best])
    divisor = 4 * q[best]
    if best == 0:
        q[1:] = [dcm[1, 2] - dcm[2, 1], dcm[2, 0] - dcm[0, 2], dcm[0, 1] - dcm[1, 0]]
        q[1:] /= divisor
    else:
        i = best - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = (dcm[j, k] - dcm[k, j]) / divisor
        q[1 + j] = (dcm[i, j] + dcm[j, i]) / divisor
        q[1 + k] = (dcm[i, k] + dcm[k, i]) / divisor
    if q[0] < 0:
        q = -q
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])
